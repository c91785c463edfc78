"""The checkers of the safety promises S1 to S5: pure functions from a history to a finding."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from operator import itemgetter

from interfaces import topics
from interfaces.topics import DRIVE_TIMEOUT, OFF, ON, TURN_OFF, TURN_ON
from tests.promises import claims
from tests.promises.effects import (
    BAD_TRANSPORT,
    BEFORE,
    LONGEST_PAUSE,
    MISSED,
    REFUSING,
    SAME,
    TRANSPORT,
    Effect,
    Reason,
    disturbing,
    undisturbed,
)
from tests.promises.findings import Evidence, Finding, count, how_often
from tests.promises.history import (
    ALL,
    CONTROLLER,
    FLOODS,
    HOST,
    SILENCE,
    SWITCH,
    WATCHDOG,
    Condition,
    History,
    Life,
    Sample,
    between,
    gaps,
    last_sent,
    merged,
    running,
)
from tests.promises.lateness import MATCHED
from tests.promises.positions import PublishedValues, may_lack_values

LETTING_GO = 1.0  # s from the operator's release until no heartbeat may come
FAIL_SAFES = {
    WATCHDOG: (Reason.SILENT, Reason.DEAF, Reason.DELAYED, *MISSED),
    CONTROLLER: (Reason.SILENT, *MISSED),
}
"""The programs of F1 and F2 (deploy/SAFETY.md), and the effects that may keep them from acting in time."""


def engines_off_in_time(history: History, found: Sequence[Effect]) -> Finding:
    """S1: engines are off in time after the operator's last sign of life."""
    alive = [s.sent for s in history.signs_of_life()]
    evidence, longest, longest_undisturbed, cases, unknown = [], 0.0, 0.0, 0, 0
    given, on = history.reaction, list(running(history))
    overloads = merged((each.begin, each.end) for each in found if each.why == Reason.OVERLOADED)
    for begin, end in gaps(alive, -math.inf, history.end):
        late = _overlapping_part(on, begin, end)
        if not late:
            continue
        # The observer may have missed the last sign of life in an overload: then the silence began later.
        observed = (
            (min(part[-1][1], two) - one, one)
            for one, two in _between(overloads, begin, end)
            if (part := _overlapping_part(on, one, two))
        )
        lasted, since = max(observed, default=(0.0, late[0][0]))
        if since == -math.inf:
            evidence.append(Evidence(late[0][0], "engines on before the operator's first sign of life"))
            continue
        if end - begin <= min(longest_undisturbed, given.off_undisturbed, given.controller.max_presence_age):
            longest = max(longest, lasted)
            continue  # nearly each time between two heartbeats: what its faults allow makes no difference
        stopped = min(late[-1][1], end)
        allowed = _allowed(history, found, begin, stopped)
        if lasted <= allowed < stopped - begin:
            unknown += 1
            continue
        longest = max(longest, lasted)
        if allowed == given.off_undisturbed:
            longest_undisturbed = max(longest_undisturbed, lasted)
        # The silence exercises the promise if it lasts until the engines are off.
        cases += late[-1][1] < end and end - begin > given.controller.max_presence_age
        if lasted > allowed:
            times = f"{allowed:g} s after the operator's last sign of life, for {lasted:.2f} s in all"
            due = since + allowed
            evidence.append(Evidence(due, f"engines still on {times}", _kept_on(history, since, due)))
    evidence += _held_without_a_hand(history, found)
    evidence += claims.last_strike_stops(history, found)
    measured = f"off within {longest:.2f} s, allowed {given.off_within:g} s"
    if longest_undisturbed:
        measured += f"; undisturbed {longest_undisturbed:.2f} s, allowed {given.off_undisturbed:g} s"
    return Finding("S1", cases, measured, evidence, unknown, worst=longest)


def engines_stay_on(history: History, found: Sequence[Effect]) -> Finding:
    """S2: while the operator is alive, killing any service but the controller keeps the engines on."""
    evidence, permitted, kills, unknown = [], 0, 0, 0
    for on, off in _changes(history, ON, OFF):
        if (
            _was_away(found, on, off)
            or _was_interrupted(history, found, on)
            or _commanded(history, found, off)
            or _abandoned(history, found, off)
        ):
            permitted += 1
        elif not undisturbed(found, ALL, off.sent - BEFORE, off.sent, *MISSED):
            unknown += 1  # the observer may have missed the command
        else:
            evidence.append(Evidence(off.sent, _not_permitted(history, found, off)))
    states = history.stream(topics.ENGINES_STATE)
    heartbeats, age = history.signs_of_life(), _shortest_absence(history)
    for fault in history.faults:
        if fault.kind == "kill" and fault.target != CONTROLLER:
            before = last_sent(states, fault.begin)
            alive = between(heartbeats, fault.begin - age, fault.begin)
            kills += bool(before and before.value == ON and alive)
    measured = f"{count(kills, 'kill')} while on; turned off {how_often(permitted)} for a permitted reason"
    return Finding("S2", kills, measured, evidence, unknown)


def turned_on_with_operator(history: History, found: Sequence[Effect]) -> Finding:
    """S3: engines turn on only by a `turn_on` with the operator present."""
    commands = [s for s in history.stream(topics.ENGINES) if s.value == TURN_ON]
    heartbeats = history.signs_of_life()
    age = history.reaction.controller.max_presence_age
    evidence, cases, unknown, oldest = [], 0, 0, 0.0
    before = -math.inf
    for stopped, on in _starts(history):
        if _was_interrupted(history, found, on):
            continue
        # A command turns the engines on once; the next start needs another one.
        command = between(commands, max(before, on.sent - age - TRANSPORT), on.sent + SAME)
        before = on.sent + SAME + 0.001
        seen = between(heartbeats, on.sent - age - TRANSPORT, on.sent + SAME)
        if command and seen:
            cases += 1
            oldest = max(oldest, on.sent - seen[-1].sent)
        elif _was_present(history, on.sent) and not undisturbed(
            found, SWITCH, on.sent, on.sent, Reason.UNDISCOVERED
        ):
            unknown += 1
        elif not undisturbed(found, CONTROLLER, max(stopped, on.sent - age), on.sent, Reason.OPPOSED):
            unknown += 1  # it was on all the time
        elif not undisturbed(found, ALL, max(stopped, on.sent - age), on.sent, *MISSED):
            unknown += 1  # the observer may have missed the command, or the states that kept them on
        else:
            missing = "a turn_on" if not command else "a sign of life"
            evidence.append(Evidence(on.sent, f"engines turned on without {missing} in the last {age:g} s"))
    evidence += claims.present_operator_is_obeyed(history, found)
    measured = f"turned on {how_often(cases)}, operator seen at most {oldest:.2f} s before"
    return Finding("S3", cases, measured, evidence, unknown)


def valid_speeds_and_positions(history: History, found: Sequence[Effect]) -> Finding:
    """S4: a speed is finite and ≥ 0; a position equals the kinematics of published values."""
    speeds = history.stream(topics.EFFECTOR_SPEED)
    evidence = [
        Evidence(s.sent, f"speed {s.value}") for s in speeds if not (math.isfinite(s.value) and s.value >= 0)
    ]
    published = PublishedValues(history)
    positions = history.stream(topics.EFFECTOR_POSITION)
    unknown = 0
    for position in positions:
        if published.explain(position, within=LONGEST_PAUSE):
            continue
        if may_lack_values(history, found, position.sent):
            unknown += 1
        else:
            evidence.append(Evidence(position.sent, f"no published values give {position.value}"))
    measured = f"{count(len(positions), 'position')}, {count(len(speeds), 'speed')}"
    return Finding("S4", len(positions) + len(speeds) - unknown, measured, evidence, unknown)


def single_instances(history: History, found: Sequence[Effect]) -> Finding:
    """S5: never two live instances of one service on a host."""
    evidence, unknown = [], 0
    for second, life in _reports_beside_another(history):
        if life.ended is not None and not undisturbed(found, ALL, second.sent, life.ended, *MISSED):
            unknown += 1  # the observer may have noted the end too late
        else:
            name, pid, *_ = second.value
            together = f"process {pid} runs {name} while process {life.pid} lives"
            evidence.append(Evidence(second.sent, together))
    evidence += _supervisors_beside_another(history)
    cases = len(history.lives) - len({life.program for life in history.lives})
    return Finding("S5", cases, f"restarts and duplicates: {cases}", sorted(evidence), unknown)


def _allowed(history: History, found: Sequence[Effect], begin: float, end: float) -> float:
    """Return within which time [s] the engines must be off, by the fail-safes that a fault hits."""
    hits = [
        any(
            not isinstance(each.cause, Condition) or each.cause.kind != SILENCE
            for each in disturbing(found, program, begin, end, *why)
        )
        for program, why in FAIL_SAFES.items()
    ]
    given = history.reaction
    return (given.off_undisturbed, given.off_after_one_death, given.off_within)[sum(hits)]


def _held_without_a_hand(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """Yield each time in which the switch sends heartbeats although the operator has let go of it."""
    signs = history.signs_of_life()
    for silence in history.conditions:
        if silence.kind != SILENCE:
            continue
        for beat in between(signs, silence.begin + LETTING_GO, silence.end - SAME):
            # A switch that was away may send what was due, and a stranger may send heartbeats.
            away = disturbing(found, SWITCH, beat.sent - SAME, beat.sent, Reason.SILENT, Reason.OVERLOADED)
            if all(each.cause is silence for each in away):
                since = beat.sent - silence.begin
                text = f"a heartbeat is sent {since:.2f} s after the operator has let go of the switch"
                yield Evidence(beat.sent, text)
                break


def _overlapping_part(
    intervals: Sequence[tuple[float, float]], begin: float, end: float
) -> Sequence[tuple[float, float]]:
    """Return the intervals, of those in order, that overlap the one from ``begin`` to ``end``."""
    first = bisect_right(intervals, begin, key=itemgetter(1))
    return intervals[first : bisect_left(intervals, end, key=itemgetter(0))]


def _kept_on(history: History, since: float, due: float) -> str:
    """Return which fail-safes did not act, of a silence that began at ``since``."""
    commands = between(history.stream(topics.ENGINES), since, due)
    commanded = any(command.value == TURN_OFF for command in commands)
    watchdog = f"{WATCHDOG} sent {'' if commanded else 'no '}{TURN_OFF}"
    states = between(history.stream(topics.ENGINES_STATE), due - DRIVE_TIMEOUT, history.end)
    last = next((state for state in states if state.value == ON), None)
    controller = f"{CONTROLLER} still sent {ON}" if last else "the drive kept the last command"
    return f"{watchdog}, {controller}"


def _between(
    intervals: Sequence[tuple[float, float]], begin: float, end: float
) -> Iterator[tuple[float, float]]:
    """Yield the parts of the time from ``begin`` to ``end`` that lie between the intervals."""
    for one, two in _overlapping_part(intervals, begin, end):
        if begin < one:
            yield begin, one
        begin = two
    if begin < end:
        yield begin, end


def _starts(history: History) -> Iterator[tuple[float, Sample]]:
    """Yield each `on` that starts the engines, with the time since when they stood still."""
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


def _was_away(found: Sequence[Effect], on: Sample, off: Sample) -> bool:
    """Return whether the controller was replaced or suspended between its `on` and its `off`."""
    if not undisturbed(found, CONTROLLER, on.sent, off.sent, Reason.REPLACED, Reason.OPPOSED):
        return True
    paused = not undisturbed(found, CONTROLLER, on.sent, off.sent, Reason.SUSPENDED, *MISSED)
    return paused and off.sent - on.sent > DRIVE_TIMEOUT


def _was_interrupted(history: History, found: Sequence[Effect], on: Sample) -> bool:
    """Return whether a suspension interrupted the sending of an `on`.

    An `off` follows it at once, unless the suspension was too short for the controller to notice.
    """
    states = between(history.stream(topics.ENGINES_STATE), on.sent, on.sent + SAME)
    is_off = any(state.value == OFF for state in states)
    return any(
        effect.end <= on.sent + SAME and (is_off or effect.end - effect.begin < DRIVE_TIMEOUT)
        for effect in disturbing(found, CONTROLLER, on.sent - SAME, on.sent, Reason.SUSPENDED)
    )


def _was_present(history: History, time: float) -> bool:
    """Return whether the operator watchdog reported the operator's presence just before."""
    presences = history.stream(topics.OPERATOR_PRESENCE)
    age = history.reaction.controller.max_presence_age
    return bool(between(presences, time - age - TRANSPORT, time + SAME))


def _commanded(history: History, found: Sequence[Effect], off: Sample) -> bool:
    """Return whether `turn_off` was commanded just before.

    The watchdog needs as many strikes for it as that takes; the other publishers of the contract need none.
    """
    just_before = _commands_before(history, found, off)
    if not all(claims.is_of_watchdog(history, command) for command in just_before):
        return True
    # Counted at the command: a successor of the watchdog begins to count again.
    strikes = (_strikes(history, found, command.sent) for command in just_before)
    return any(number >= history.reaction.watchdog.strikes for number in strikes)


def _commands_before(history: History, found: Sequence[Effect], off: Sample) -> Sequence[Sample]:
    """Return each `turn_off` that may have led to an `off`."""
    commands = [s for s in history.stream(topics.ENGINES) if s.value == TURN_OFF]
    return between(commands, off.sent - _transport(found, off.sent), off.sent + SAME)


def _not_permitted(history: History, found: Sequence[Effect], off: Sample) -> str:
    """Return what is wrong with an `off` that nothing permits."""
    strikes = [_strikes(history, found, command.sent) for command in _commands_before(history, found, off)]
    if not strikes:
        return "engines turned off although the operator was present"
    needed = history.reaction.watchdog.strikes
    return f"{WATCHDOG} turned the engines off after {max(strikes):g} of {needed} strikes"


def _transport(found: Sequence[Effect], time: float) -> float:
    """Return how long a message may have taken that arrived then [s]."""
    quick = undisturbed(found, ALL, time - BAD_TRANSPORT, time, Reason.DELAYED)
    return TRANSPORT if quick else BAD_TRANSPORT


def _strikes(history: History, found: Sequence[Effect], time: float) -> float:
    """Return how many strikes the watchdog may have counted since its start or its last command."""
    commands = (
        s.sent
        for s in history.stream(topics.ENGINES)
        if s.value == TURN_OFF and s.sent < time - 1.0 and claims.is_of_watchdog(history, s)
    )
    starts = (life.began for life in history.lives_of(WATCHDOG) if life.began < time)
    since = max([*commands, *starts], default=0.0)
    signs = history.signs_of_life()
    last = last_sent(signs, since)
    begin = last.sent if last else 0.0
    given = history.reaction.watchdog
    # A suspended watchdog receives no heartbeat either, nor the last one before; S2 does not cover that.
    deaf = [
        (max(effect.begin - given.reading, begin), min(effect.end, time))
        for effect in disturbing(found, WATCHDOG, begin, time, Reason.DEAF)
    ]
    # On a bad line, and of a new switch, it may miss heartbeats that the observer hears.
    missed = [(each.begin, each.end) for each in disturbing(found, ALL, begin, time, Reason.DELAYED)]
    missed += [(life.began, life.began + MATCHED) for life in history.lives_of(SWITCH) if life.began > begin]
    sent = (each.sent for each in between(signs, begin, time))
    heartbeats = (at for at in sent if not _is_inside(at, missed))
    # Intervals that only touch have a heartbeat in between.
    silences = merged([*gaps(heartbeats, begin, time), *deaf])
    # Other heartbeats delay those of the operator.
    floods = [(each.begin, each.end) for each in history.faults if each.kind in FLOODS and each.end > begin]
    return sum(
        (end - begin + given.sampling + BAD_TRANSPORT * _is_inside(end, floods)) // given.silence
        for begin, end in silences
    )


def _is_inside(time: float, intervals: Sequence[tuple[float, float]]) -> bool:
    return any(begin < time < end for begin, end in intervals)


def _abandoned(history: History, found: Sequence[Effect], off: Sample) -> bool:
    """Return whether the operator or a suspended watchdog left the controller without a presence."""
    given = history.reaction
    # A presence is as old as its heartbeat, and the watchdog reads that one a little later.
    begin = off.sent - given.controller.presence_timeout + given.watchdog.reading + TRANSPORT
    deaf = list(disturbing(found, WATCHDOG, begin, off.sent, Reason.DEAF))
    signs = history.signs_of_life()
    for presence in between(history.stream(topics.OPERATOR_PRESENCE), begin, off.sent - TRANSPORT):
        seen = last_sent(signs, presence.sent)
        # A presence sent right after resuming may stem from an older heartbeat.
        is_deaf = any(each.begin < presence.sent <= each.end + TRANSPORT for each in deaf)
        arrives = undisturbed(found, CONTROLLER, presence.sent, presence.sent, Reason.DEAF)
        if seen and seen.sent > begin and arrives and not is_deaf:
            return False
    heartbeats = [s.sent for s in signs]
    absence = _shortest_absence(history)
    silent = any(two - one > absence for one, two in gaps(heartbeats, begin, off.sent))
    return silent or bool(deaf)


def _shortest_absence(history: History) -> float:
    """Return after how long without a heartbeat the operator may be absent [s]."""
    given = history.reaction
    # A switch that is held may beat less often than `turn_on` needs a presence.
    return max(given.controller.max_presence_age, 1.0 / given.switch.rate + TRANSPORT)


def _supervisors_beside_another(history: History) -> Iterator[Evidence]:
    """Yield each supervisord that does not end although another one lives; it reports nothing."""
    lives = sorted((life for life in history.lives if not life.program), key=lambda life: life.began)
    for one, two in itertools.combinations(lives, 2):
        last = min(history.end if life.ended is None else life.ended for life in (one, two))
        if last - two.began > REFUSING:
            yield Evidence(two.began, f"processes {one.pid} and {two.pid} are both supervisord")


def _reports_beside_another(history: History) -> Iterator[tuple[Sample, Life]]:
    """Yield the first health report of a process if another one that has reported before still lives.

    A process that is not the first claims the name of its service in vain, and then reports nothing. How
    soon it ends depends on the machine.
    """
    lives = {(life.program, life.pid): life for life in history.lives}
    instances: dict[tuple[str, str], set[int]] = {}
    for sample in history.stream(topics.DIAGNOSTICS):
        name, pid, *given = sample.value
        known = instances.setdefault((name, dict(given).get(HOST, "")), set())
        if pid in known:
            continue
        for life in filter(None, (lives.get((name, other)) for other in sorted(known))):
            if life.ended is None or life.ended > sample.sent:
                yield sample, life
        known.add(pid)
