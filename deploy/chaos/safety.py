"""The safety promises S1 to S5: pure functions from a history to a finding."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter

from deploy.chaos.findings import Evidence, Finding
from deploy.chaos.history import ALL, BLINDING, History, Life, Sample, between, gaps
from interfaces import topics
from interfaces.topics import DRIVE_TIMEOUT, OFF, ON, TURN_OFF, TURN_ON

OFF_WITHIN = 10.5  # s, S1
ABSENCE = 10.0  # s without a presence after which the controller turns the engines off
STRIKE, STRIKES = 3.0, 3  # s; silences after which the operator watchdog turns the engines off
SAMPLING = 0.5  # s by which it may notice the begin of a silence early
SEEN_WITHIN = 1.0  # s, S3
TRANSPORT = 0.15  # s that a message may take on a busy machine
ROUNDING = 1e-8  # m
LONGEST_PAUSE = 20.0  # s that a process may have stood still, and its values be old
MEETING = 1.0  # s from the first message that the observer got until all have discovered a process
CLAIM = 5.0  # s within which a double has to notice that it is one


def engines_off_in_time(history: History) -> Finding:
    """S1: engines are off at most 10.5 s after the operator's last sign of life."""
    alive = [s.sent for s in _signs_of_life(history)]
    evidence, longest, cases = [], 0.0, 0
    stretches = list(running(history))
    for begin, end in gaps(alive, -math.inf, history.end):
        after = bisect_right(stretches, begin, key=itemgetter(1))
        late = stretches[after : bisect_left(stretches, end, key=itemgetter(0))]
        if not late:
            continue
        if begin == -math.inf:
            evidence.append(Evidence(late[0][0], "engines on before the operator's first sign of life"))
            continue
        last = min(late[-1][1], end)
        longest = max(longest, last - begin)
        # It was put to the test if the operator stayed away until they were off.
        cases += late[-1][1] < end and end - begin > SEEN_WITHIN
        if last - begin > OFF_WITHIN:
            what = f"engines still on {last - begin:.2f} s after the operator's last sign of life"
            evidence.append(Evidence(begin + OFF_WITHIN, what))
    return Finding("S1", cases, f"off after {longest:.2f} s at most, allowed {OFF_WITHIN} s", evidence)


def stays_on(history: History) -> Finding:
    """S2: while the operator is alive, no kill of any other service turns the engines off."""
    evidence, explained, held, unknown = [], 0, 0, 0
    for on, off in _changes(history, ON, OFF):
        if _controller_was_away(history, on, off) or _commanded(history, off) or _abandoned(history, off):
            explained += 1
        elif history.may_have_missed(off.sent - 1.0, off.sent):
            unknown += 1  # the command
        else:
            evidence.append(Evidence(off.sent, "engines turned off though the operator was there"))
    states = history.stream(topics.ENGINES_STATE)
    heartbeats = _signs_of_life(history)
    for fault in history.faults:
        if fault.kind == "kill" and fault.target != "engine_controller":
            before = _last(states, fault.begin)
            alive = between(heartbeats, fault.begin - SEEN_WITHIN, fault.begin)
            held += bool(before and before.value == ON and alive)
    figures = f"{held} kills while on; off {explained} times for a good reason"
    return Finding("S2", held, figures, evidence, unknown)


def turned_on_by_the_present(history: History) -> Finding:
    """S3: engines go on only by a `turn_on` with the operator present."""
    commands = [s for s in history.stream(topics.ENGINES) if s.value == TURN_ON]
    heartbeats = _signs_of_life(history)
    evidence, cases, unknown, oldest = [], 0, 0, 0.0
    before = -math.inf
    for stopped, on in _starts(history):
        # A command starts them once: not again after they were turned off.
        command = between(commands, max(before, on.sent - SEEN_WITHIN - TRANSPORT), on.sent + 0.01)
        before = on.sent + 0.011
        seen = between(heartbeats, on.sent - SEEN_WITHIN - TRANSPORT, on.sent + 0.01)
        if command and seen:
            cases += 1
            oldest = max(oldest, on.sent - seen[-1].sent)
        elif _told_of(history, on.sent) and any(
            on.sent - 3.0 < life.began <= on.sent for life in history.lives_of("dead_mans_switch")
        ):
            unknown += 1  # a command or heartbeat of a new publisher, which the observer did not know yet
        elif history.may_have_missed(max(stopped, on.sent - SEEN_WITHIN), on.sent):
            unknown += 1  # what kept them on, or the command
        else:
            missing = "a turn_on" if not command else "a sign of life"
            evidence.append(Evidence(on.sent, f"engines went on without {missing} in the last second"))
    return Finding("S3", cases, f"{cases} times on, operator seen {oldest:.2f} s before", evidence, unknown)


def speeds_and_positions_are_true(history: History) -> Finding:
    """S4: a speed is finite and ≥ 0; a position equals the kinematics of values that were published."""
    evidence = [
        Evidence(s.sent, f"speed {s.value}")
        for s in history.stream(topics.EFFECTOR_SPEED)
        if not (math.isfinite(s.value) and s.value >= 0)
    ]
    published = Published(history)
    positions = history.stream(topics.EFFECTOR_POSITION)
    unknown = 0
    for position in positions:
        if published.explains(position, within=LONGEST_PAUSE):
            continue
        if may_have_missed_values(history, position.sent):
            unknown += 1
        else:
            evidence.append(Evidence(position.sent, f"position {position.value} of no published values"))
    speeds = len(history.stream(topics.EFFECTOR_SPEED))
    return Finding(
        "S4",
        len(positions) + speeds - unknown,
        f"{len(positions)} positions, {speeds} speeds",
        evidence,
        unknown,
    )


def never_two_alive(history: History) -> Finding:
    """S5: never two live instances of one service."""
    evidence, cases = [], 0
    for _, group in itertools.groupby(
        sorted(history.lives, key=lambda life: (life.program, life.began)), lambda life: life.program
    ):
        lives = list(group)
        cases += len(lives) - 1
        evidence += [_two(a, b) for a, b in _overlapping(lives, history.end)]
    evidence += list(_interleaved(history))
    return Finding("S5", cases, f"{cases} successors and doubles", sorted(evidence))


def may_have_missed_values(history: History, time: float) -> bool:
    """Whether others may have got a value that the observer did not: it may have met its source later."""
    if history.may_have_missed(time - MEETING, time):
        return True
    for life in history.lives:
        if life.program.startswith("config_") and life.began < time:
            output = history.output(life.program)
            first = bisect_right(output, life.began, key=lambda s: s.sent)
            if first == len(output) or time < output[first].sent + MEETING:
                return True
    return False


class Published:
    """The values that were published, and what positions follow from them."""

    def __init__(self, history: History) -> None:
        self._streams = [history.stream(topic) for topic in topics.CONFIGURATION.values()]

    def explains(self, position: Sample, within: float) -> bool:
        """Whether it follows from values that were the latest within so many seconds before it was sent."""
        # Nearly always from the latest ones: so these first, and only then ever older ones.
        for window in (0.05, 0.3, 2.0, LONGEST_PAUSE):
            candidates = [
                self._candidates(stream, position.sent, min(window, within)) for stream in self._streams
            ]
            if _any_fits(candidates, *position.value):
                return True
            if window >= within:
                break
        return False

    @staticmethod
    def _candidates(stream: Sequence[Sample], time: float, window: float) -> list[float]:
        """What was the latest value at some moment of the window, the latest first."""
        newest = bisect_right(stream, time + 0.005, key=lambda s: s.sent)
        oldest = bisect_right(stream, time - window, key=lambda s: s.sent)
        return [s.value for s in reversed(stream[max(0, oldest - 1) : newest])]


def _any_fits(candidates: list[list[float]], x: float, y: float) -> bool:
    """Whether some values give the position, up to rounding."""
    if not (math.isfinite(x) and math.isfinite(y)):
        return False
    l1s, l2s, theta1s, theta2s = candidates
    l2s = sorted(l2s)
    for theta1, l1 in itertools.product(theta1s, l1s):
        # What is left for the second link has to fit in length before angles are tried.
        rest_x, rest_y = x - l1 * math.cos(theta1), y - l1 * math.sin(theta1)
        length = math.hypot(rest_x, rest_y)
        for l2 in l2s[bisect_left(l2s, length - ROUNDING) : bisect_right(l2s, length + ROUNDING)]:
            for theta2 in theta2s:
                heading = theta1 + theta2
                error_x, error_y = rest_x - l2 * math.cos(heading), rest_y - l2 * math.sin(heading)
                if abs(error_x) < ROUNDING and abs(error_y) < ROUNDING:
                    return True
    return False


def running(history: History) -> Iterator[tuple[float, float]]:
    """The stretches for which the engines run: renewed by each `on`, ended by an `off` or by nothing."""
    states = history.stream(topics.ENGINES_STATE)
    for state, following in itertools.zip_longest(states, states[1:]):
        if state.value == ON:
            yield state.sent, min(following.sent if following else history.end, state.sent + DRIVE_TIMEOUT)


def _starts(history: History) -> Iterator[tuple[float, Sample]]:
    """Each `on` that sets the engines going, and since when they stood still: also without an `off`."""
    stopped = -math.inf
    states = {state.sent: state for state in history.stream(topics.ENGINES_STATE)}
    for begin, end in running(history):
        if begin > stopped:
            yield stopped, states[begin]
        stopped = end


def _changes(history: History, before: str, after: str) -> Iterator[tuple[Sample, Sample]]:
    for one, two in itertools.pairwise(history.stream(topics.ENGINES_STATE)):
        if (one.value, two.value) == (before, after):
            yield one, two


def _controller_was_away(history: History, on: Sample, off: Sample) -> bool:
    """Whether another process than that which said `on` may have said `off`, or it was paused in between."""
    died = any(on.sent - 0.02 < life.began <= off.sent for life in history.lives_of("engine_controller"))
    paused = history.may_have_missed(on.sent, off.sent) or any(
        fault.kind in BLINDING
        and fault.target in ("engine_controller", ALL)
        and fault.overlaps(on.sent, off.sent)
        for fault in history.faults
    )
    return died or (paused and off.sent - on.sent > DRIVE_TIMEOUT)


def _signs_of_life(history: History) -> list[Sample]:
    """The heartbeats of an operator who holds the switch."""
    return [s for s in history.stream(topics.OPERATOR_HEARTBEAT) if s.value is True]


def _told_of(history: History, time: float) -> bool:
    """Whether the operator watchdog saw the operator in the second before."""
    presences = history.stream(topics.OPERATOR_PRESENCE)
    return bool(between(presences, time - SEEN_WITHIN - TRANSPORT, time + 0.01))


def _commanded(history: History, off: Sample) -> bool:
    """Whether a `turn_off` was said just before, for as many silences as that takes."""
    commands = [s for s in history.stream(topics.ENGINES) if s.value == TURN_OFF]
    if not between(commands, off.sent - TRANSPORT, off.sent + 0.01):
        return False
    return _absences(history, off.sent) >= STRIKES


def _absences(history: History, time: float) -> float:
    """The strikes that the operator watchdog of a time may have counted until then, since it counted anew."""
    commands = (s.sent for s in history.stream(topics.ENGINES) if s.value == TURN_OFF and s.sent < time - 1.0)
    births = (life.began for life in history.lives_of("operator_watchdog") if life.began < time)
    since = max([*commands, *births], default=0.0)
    heartbeats = [s.sent for s in _signs_of_life(history)]
    begin = max((t for t in heartbeats if t <= since), default=0.0)
    # While it was stopped it saw nobody either: that is what S2 does not promise.
    blind = [(max(one, begin), min(two, time)) for one, two in _blind(history) if one < time and two > begin]
    silences = _merged([*gaps(heartbeats, begin, time), *blind])
    return sum((end - begin + SAMPLING) // STRIKE for begin, end in silences)


def _merged(stretches: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The stretches, those that overlap as one. Those that only touch stay two: a silence and the next."""
    merged: list[tuple[float, float]] = []
    for begin, end in sorted(stretches):
        if merged and begin < merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((begin, end))
    return merged


def _abandoned(history: History, off: Sample) -> bool:
    """Whether the controller saw nobody for ten seconds: the operator was silent, or the watchdog blind."""
    presences = history.stream(topics.OPERATOR_PRESENCE)
    begin = off.sent - ABSENCE + SAMPLING + TRANSPORT  # a presence is as old as its stamp
    if between(presences, begin, off.sent - TRANSPORT):
        return False
    heartbeats = [s.sent for s in _signs_of_life(history)]
    silent = any(two - one > SEEN_WITHIN for one, two in gaps(heartbeats, begin, off.sent))
    return silent or any(one < off.sent and two > begin for one, two in _blind(history))


def _blind(history: History) -> Iterator[tuple[float, float]]:
    """When an operator watchdog heard nobody: it was paused by the monkey, until it died or went on."""
    for fault in history.faults:
        if fault.kind in BLINDING and fault.target in ("operator_watchdog", ALL):
            yield fault.begin, history.ended(fault)


def _last(samples: Sequence[Sample], time: float) -> Sample | None:
    index = bisect_right(samples, time, key=lambda s: s.sent)
    return samples[index - 1] if index else None


def _overlapping(lives: Sequence[Life], end: float) -> Iterator[tuple[Life, Life]]:
    for one, two in itertools.combinations(lives, 2):
        last = min(end if one.ended is None else one.ended, end if two.ended is None else two.ended)
        if last - max(one.began, two.began) > CLAIM:
            yield one, two


def _two(one: Life, two: Life) -> Evidence:
    return Evidence(two.began, f"processes {one.pid} and {two.pid} are both {one.program or 'supervisord'}")


def _interleaved(history: History) -> Iterator[Evidence]:
    """Health reports of one name, of a process, of another one, and of the first one again."""
    gone: dict[str, set[int]] = {}
    last: dict[str, int] = {}
    for sample in history.stream(topics.DIAGNOSTICS):
        name, pid = sample.value
        if pid in gone.setdefault(name, set()):
            yield Evidence(sample.sent, f"process {pid} is {name} besides process {last[name]}")
            gone[name].discard(pid)
        if last.get(name, pid) != pid:
            gone[name].add(last[name])
        last[name] = pid
