"""The checkers of the liveness promises L1 to L4: pure functions from a history to a finding."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence

from deploy.supervision.policy import Timeouts
from interfaces import topics
from services import robot_state
from tests.promises import claims
from tests.promises.effects import (
    BEFORE,
    FLOWING,
    KILLING,
    LASTING,
    MISSED,
    RESTARTED,
    SAME,
    SETTLED,
    Effect,
    Reason,
    disturbed_for,
    undisturbed,
)
from tests.promises.findings import Evidence, Finding, count, percentile
from tests.promises.history import (
    ALL,
    CONTROLLER,
    DEPENDENTS,
    KINEMATICS,
    OUTPUTS,
    ROBOT_STATE,
    SENTINEL,
    SOURCES,
    SUSPENDING,
    SWITCH,
    History,
    InjectedFault,
    Sample,
    between,
)
from tests.promises.limits import GAP, GONE, HUNG, MEDIAN, SLOWEST, STREAM
from tests.promises.positions import PublishedValues, may_lack_values

SAMPLES = 3  # the least number of cases for a median

STREAMS = frozenset(program for program, topic in OUTPUTS.items() if topic.longest_gap <= GAP)
MOMENTARY = ("kill", "terminate", "raise")
HANGS = ("stop", "hang")


def output_resumes(history: History, found: Sequence[Effect]) -> Finding:
    """L1: after SIGKILL of any service its output flows again: p50 ≤ 1.0 s, p99 ≤ 2.0 s."""
    silences: dict[str, list[tuple[float, float]]] = {}  # how long, and when they began
    evidence, unknown = [], 0
    for fault in _kills(history):
        time, begin = _recovery(history, fault), _death(history, fault)
        if (
            time is None
            or not _is_alone(found, fault, fault.begin, begin + min(time, SLOWEST))
            or any(_excused(found, fault.target, begin, time, bound) for bound in (MEDIAN, SLOWEST))
        ):
            unknown += 1
        else:
            silences.setdefault(fault.target, []).append((time, fault.begin))
            if time > SLOWEST:
                text = f"{fault.target} is silent {_duration(time)} after SIGKILL"
                evidence.append(Evidence(fault.begin, text, _not_back(history, fault)))
    times = {program: [time for time, _ in each] for program, each in silences.items()}
    for program, values in times.items():
        if len(values) >= SAMPLES and (median := percentile(values, 50)) > MEDIAN:
            longest, begin = max(silences[program])
            text = f"{program}: the median silence after its {len(values)} kills is {median:.2f} s"
            evidence.append(Evidence(begin, text, f"after this kill, it was silent {_duration(longest)}"))
    evidence += _silent_for_good(history, found)
    every = [time for values in times.values() for time in values]
    measured = f"p50 {percentile(every, 50):.2f} s, p99 {percentile(every, 99):.2f} s" if every else ""
    return Finding("L1", len(every), measured, evidence, unknown, times, max(every, default=-math.inf))


def _kills(history: History) -> Iterator[InjectedFault]:
    return (fault for fault in history.faults if fault.kind == "kill")


def _silent_for_good(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """Yield programs without output after a fault of any kind, unless another fault explains it."""
    for fault in history.faults:
        begin = max(fault.end, _death(history, fault), _start_limit(history, fault))
        end = begin + GONE
        if end > history.end:
            continue
        for program in history.programs if fault.target == ALL else (fault.target,):
            if history.lacks(program):
                continue
            output = history.output(program)
            if between(output, begin + SAME, end):
                continue
            # A constant is published once: then the health shows that the program works.
            is_constant = program in SOURCES and len({each.value for each in output}) == 1
            is_rare = is_constant or _period(output) > FLOWING
            if is_rare and between(history.health(program), begin, end):
                continue
            # Where nothing moves, there is nothing to publish.
            if end - begin <= disturbed_for(found, program, begin, end, Reason.STILL) + FLOWING:
                continue
            # A program that waits for a value needs time after that, too.
            if end - begin < disturbed_for(found, program, begin, end, Reason.WAITING) + HUNG:
                continue
            if undisturbed(found, program, begin, end, Reason.SILENT, but=fault):
                yield Evidence(end, f"{program} is silent for {GONE:g} s after {fault.kind}")


def _start_limit(history: History, fault: InjectedFault) -> float:
    """Return until when the sentinel lets a process start that hangs before its first sign of life [s]."""
    for life in history.lives_of(fault.target):
        is_hung = fault.kind == "hang" and life.pid == fault.pid
        if is_hung and not between(history.health(fault.target), life.began, fault.begin):
            timeout = history.parameters.get(SENTINEL, {}).get("start_timeout", Timeouts.start)
            return life.began + float(timeout)
    return fault.begin


def other_streams_flow(history: History, found: Sequence[Effect]) -> Finding:
    """L2: meanwhile the other services' continuous streams (5 Hz or faster) show no gap over 250 ms."""
    cases, unknown, longest = 0, 0, 0.0
    periods = {each: _expected_period(history, each) for each in history.programs if each in STREAMS}
    # A user may choose slower ones.
    streams = [program for program, period in periods.items() if round(period, 2) <= STREAM]
    evidence = [
        Evidence(
            history.output(program)[0].sent,
            f"{program} has a usual gap of {period:.2f} s instead of {periods[program]:.2f} s",
        )
        for program in streams
        if GAP < (period := _period(history.output(program))) < math.inf
    ]
    for fault in _kills(history):
        end = _death(history, fault) + min(_recovery(history, fault) or SLOWEST, SLOWEST)
        for program in streams:
            if not _flowed(history, program, fault.begin, GAP):
                continue
            if program == KINEMATICS and not _leaves_a_source(history, fault):
                continue
            if not undisturbed(found, program, fault.begin - BEFORE, end + GAP, Reason.SILENT):
                continue
            excused = 0
            for one, two in _intervals(history, program, fault.begin - GAP, end):
                if (
                    two - one
                    > GAP
                    >= two - one - disturbed_for(found, program, one, two, *MISSED, Reason.STILL)
                ):
                    excused = 1  # the observer may have missed messages, or there was nothing to publish
                    continue
                longest = max(longest, two - one)
                if two - one > GAP:
                    text = f"{program} is silent for {two - one:.2f} s when {fault.target} is killed"
                    evidence.append(Evidence(one, text))
            cases += 1 - excused
            unknown += excused
    measured = f"longest gap {1000 * longest:.0f} ms, allowed {1000 * GAP:.0f} ms"
    return Finding("L2", cases, measured, evidence, unknown, worst=longest)


def _leaves_a_source(history: History, fault: InjectedFault) -> bool:
    """Return whether a source that no fault hits publishes values: kinematics follows them."""
    hit = (fault.target, *DEPENDENTS.get(fault.target, ()))
    return any(_flowed(history, each, fault.begin, GAP) for each in SOURCES if each not in hit)


def _intervals(history: History, program: str, begin: float, end: float) -> Iterator[tuple[float, float]]:
    """Yield the interval from each message sent between two times to the next one, or to the record's end."""
    output = history.output(program)
    first = bisect_left(output, begin, key=lambda s: s.sent)
    last = bisect_right(output, end, key=lambda s: s.sent)
    following = output[last].sent if last < len(output) else history.end
    return itertools.pairwise([*(s.sent for s in output[first:last]), following])


def _period(output: Sequence[Sample]) -> float:
    """Return the usual time between two messages [s]; infinite if there are less than two.

    A stream that is often interrupted has many longer ones.
    """
    times = [two.sent - one.sent for one, two in itertools.pairwise(output)]
    return percentile(times, 25) if times else math.inf


def _expected_period(history: History, program: str) -> float:
    """Return the time between two messages of a stream [s]: by its parameters, or as it usually is.

    Only the scenario knows that of the sources and the drive, and an old record may not show that of the
    switch. Kinematics is as fast as each source.
    """
    rate = history.parameters.get(program, {}).get("rate")
    if program == SWITCH and rate:
        return 1.0 / float(rate)
    if program == CONTROLLER:
        return history.reaction.controller.repeat
    if program == ROBOT_STATE:
        return 1.0 / float(rate or robot_state.Parameters.rate)
    if program == KINEMATICS:
        return min(_period(history.output(source)) for source in SOURCES)
    return _period(history.output(program))


def right_after_restart(history: History, found: Sequence[Effect]) -> Finding:
    """L3: values that changed while a service was dead are right after its return."""
    published = PublishedValues(history)
    evidence, cases, unknown = [], 0, 0
    for fault in history.faults:
        if fault.target not in (KINEMATICS, *SOURCES) or fault.kind not in (*MOMENTARY, *LASTING):
            continue
        time = _recovery(history, fault)
        if time is None:
            continue
        begin = _death(history, fault) + time + SETTLED
        if not undisturbed(found, KINEMATICS, begin, begin + 1.0, Reason.SILENT, but=fault):
            continue
        positions = between(history.stream(topics.EFFECTOR_POSITION), begin, begin + 1.0)
        right = bool(positions) and published.explain(positions[-1], within=SETTLED)
        if positions and not right and may_lack_values(history, found, positions[-1].sent):
            unknown += 1
            continue
        cases += bool(positions)
        if positions and not right:
            text = f"the position does not follow from the last values after {fault.kind} of {fault.target}"
            evidence.append(Evidence(positions[-1].sent, text))
    measured = f"right after {cases - len(evidence)} of {count(cases, 'return')}"
    return Finding("L3", cases, measured, evidence, unknown)


def hung_is_replaced(history: History, found: Sequence[Effect]) -> Finding:
    """L4: a hung service is replaced within 5 s."""
    times: dict[str, list[float]] = {}
    evidence, unknown = [], 0
    for fault in history.faults:
        lasted = fault.end - fault.begin
        if fault.kind not in HANGS or fault.target not in history.programs or lasted < HUNG:
            continue
        time = _recovery(history, fault)
        until = fault.begin + (0.0 if time is None else min(time, HUNG))
        if (
            time is None
            or not undisturbed(found, fault.target, fault.begin - BEFORE, until, Reason.UNWATCHED, but=fault)
            or not _is_alone(found, fault, fault.begin, until)
            or _excused(found, fault.target, fault.begin, time, HUNG)
        ):
            unknown += 1
            continue
        times.setdefault(fault.target, []).append(time)
        if time > HUNG:
            text = f"{fault.target} hangs and is silent {_duration(time)}"
            cause = _not_replaced(history, fault)
            if not cause:
                text, cause = f"{SENTINEL} lived, but did not replace {fault.target}", text
            evidence.append(Evidence(fault.begin, text, cause))
    evidence += claims.ends_have_causes(history, found)
    every = [time for values in times.values() for time in values]
    measured = f"replaced within {max(every):.2f} s, allowed {HUNG:g} s" if every else ""
    return Finding("L4", len(every), measured, evidence, unknown, times, max(every, default=-math.inf))


def _not_back(history: History, fault: InjectedFault) -> str:
    """Return why a killed program may be silent: who had to act, and what is known of that."""
    began = [
        life.began for life in history.lives if life.program == fault.target and life.began > fault.begin
    ]
    if began:
        return f"its successor started after {min(began) - fault.begin:.2f} s"
    return "supervisord did not start it again"


def _not_replaced(history: History, fault: InjectedFault) -> str:
    """Return why a program may hang for long; empty if the sentinel had to act, and lived."""
    ended = history.effect_end(fault)
    if ended < fault.end and ended - fault.begin <= HUNG:
        return f"it was killed after {ended - fault.begin:.2f} s, but its successor was silent"
    is_heard = between(history.output(SENTINEL), fault.begin, fault.begin + HUNG)
    return "" if is_heard else f"{SENTINEL} was silent, too"


def _recovery(history: History, fault: InjectedFault) -> float | None:
    """Return how long a program is silent after a fault [s]; ``None`` if it was silent before."""
    output = history.output(fault.target)
    if not _flowed(history, fault.target, fault.begin, FLOWING):
        return None
    begin = _death(history, fault)
    silent = begin + SAME
    if fault.kind in SUSPENDING and any(life.pid == fault.pid for life in history.lives_of(fault.target)):
        # A busy machine still sends what was begun: only its successor ends the silence, or its return.
        silent = max(silent, history.effect_end(fault) - RESTARTED)
    if following := between(output, silent, history.end):
        # One that was sent later may be received earlier.
        return min(s.received for s in between(following, silent, following[0].received)) - begin
    # Silent for good, if the record is long enough to show it.
    return math.inf if history.end - begin > HUNG else None


def _excused(found: Sequence[Effect], program: str, begin: float, time: float, bound: float) -> bool:
    """Return whether a silence that began at a time is above a bound only for another reason.

    The whole machine paused, or there was nothing to publish.
    """
    excused = disturbed_for(found, program, begin, begin + time, *MISSED, Reason.STILL)
    return time > bound >= time - excused


def _death(history: History, fault: InjectedFault) -> float:
    """Return when a killed process ended; otherwise when the fault began."""
    ends = (
        life.ended
        for life in history.lives
        if life.pid == fault.pid and life.program == fault.target and life.ended is not None
    )
    if fault.kind in MOMENTARY:
        return next((end for end in ends if 0.0 <= end - fault.begin <= KILLING), fault.begin)
    return fault.begin


def _flowed(history: History, program: str, time: float, within: float) -> bool:
    return bool(between(history.output(program), time - within, time))


def _is_alone(found: Sequence[Effect], fault: InjectedFault, begin: float, end: float) -> bool:
    """Return whether only this fault disturbs the return of its target."""
    return undisturbed(found, fault.target, begin, end, Reason.SILENT, but=fault) and all(
        undisturbed(found, fault.target, time, time, Reason.WAITING) for time in (begin, end)
    )


def _duration(time: float) -> str:
    return "for good" if time == math.inf else f"for {time:.2f} s"
