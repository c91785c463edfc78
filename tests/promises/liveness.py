"""The checkers of the liveness promises L1 to L4: pure functions from a history to a finding."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence

from interfaces import topics
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
    Why,
    disturbed_for,
    effects,
    undisturbed,
)
from tests.promises.findings import Evidence, Finding, count, percentile
from tests.promises.history import (
    ALL,
    DEPENDENTS,
    KINEMATICS,
    OUTPUTS,
    PROGRAMS,
    SOURCES,
    History,
    InjectedFault,
    between,
)
from tests.promises.limits import GAP, GONE, HUNG, MEDIAN, SLOWEST
from tests.promises.positions import PublishedValues, may_lack_values

SAMPLES = 3  # the least number of cases for a median

STREAMS = tuple(program for program, topic in OUTPUTS.items() if topic.longest_gap <= GAP)
MOMENTARY = ("kill", "terminate", "raise")
HANGS = ("stop", "hang")


def output_resumes(history: History) -> Finding:
    """L1: after SIGKILL of any service its output flows again: p50 ≤ 1.0 s, p99 ≤ 2.0 s."""
    times: dict[str, list[float]] = {}
    found = effects(history)
    evidence, unknown = [], 0
    for fault in _kills(history):
        time = _recovery(history, fault)
        if (
            time is None
            or not _is_alone(found, fault, fault.begin, fault.begin + min(time, SLOWEST))
            or any(_paused(found, fault, time, bound) for bound in (MEDIAN, SLOWEST))
        ):
            unknown += 1
        else:
            times.setdefault(fault.target, []).append(time)
            if time > SLOWEST:
                text = f"{fault.target} is silent {_duration(time)} after SIGKILL"
                evidence.append(Evidence(fault.begin, text))
    for program, values in times.items():
        if len(values) >= SAMPLES and (median := percentile(values, 50)) > MEDIAN:
            evidence.append(Evidence(0.0, f"{program}: the median silence after SIGKILL is {median:.2f} s"))
    evidence += _silent_for_good(history, found)
    every = [time for values in times.values() for time in values]
    measured = f"p50 {percentile(every, 50):.2f} s, p99 {percentile(every, 99):.2f} s" if every else ""
    return Finding("L1", len(every), measured, evidence, unknown, times, max(every, default=math.nan))


def _kills(history: History) -> Iterator[InjectedFault]:
    return (fault for fault in history.faults if fault.kind == "kill")


def _silent_for_good(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """Yield programs without output after a fault of any kind, unless another fault explains it."""
    for fault in history.injected:
        begin, end = fault.end, fault.end + GONE
        if end > history.end:
            continue
        for program in PROGRAMS if fault.target == ALL else (fault.target,):
            if (
                program not in PROGRAMS
                or history.lacks(program)
                or between(history.output(program), begin, end)
            ):
                continue
            if _is_alone(found, fault, begin, end, program):
                yield Evidence(end, f"{program} is silent for {GONE:g} s after {fault.kind}")


def other_streams_flow(history: History) -> Finding:
    """L2: meanwhile the other services' continuous streams (4 Hz or faster) show no gap over 250 ms."""
    found = effects(history)
    evidence, cases, unknown, longest = [], 0, 0, 0.0
    for fault in _kills(history):
        end = fault.begin + min(_recovery(history, fault) or SLOWEST, SLOWEST)
        for program in STREAMS:
            if not _flowed(history, program, fault.begin, GAP):
                continue
            if not undisturbed(found, program, fault.begin - BEFORE, end + GAP, Why.SILENT):
                continue
            excused = 0
            for one, two in _intervals(history, program, fault.begin - GAP, end):
                if two - one > GAP >= two - one - disturbed_for(found, program, one, two, *MISSED, Why.STILL):
                    excused = 1  # the observer may have missed messages, or there was nothing to tell
                    continue
                longest = max(longest, two - one)
                if two - one > GAP:
                    text = f"{program} is silent for {two - one:.2f} s when {fault.target} is killed"
                    evidence.append(Evidence(one, text))
            cases += 1 - excused
            unknown += excused
    measured = f"longest gap {1000 * longest:.0f} ms, allowed {1000 * GAP:.0f} ms"
    return Finding("L2", cases, measured, evidence, unknown, worst=longest)


def _intervals(history: History, program: str, begin: float, end: float) -> Iterator[tuple[float, float]]:
    """Yield the interval from each message sent between two times to the next one, or to the record's end."""
    output = history.output(program)
    first = bisect_left(output, begin, key=lambda s: s.sent)
    last = bisect_right(output, end, key=lambda s: s.sent)
    following = output[last].sent if last < len(output) else history.end
    return itertools.pairwise([*(s.sent for s in output[first:last]), following])


def right_after_restart(history: History) -> Finding:
    """L3: values that changed while a service was dead are right after its return."""
    found = effects(history)
    published = PublishedValues(history)
    evidence, cases, unknown = [], 0, 0
    for fault in history.faults:
        if fault.target not in (KINEMATICS, *SOURCES) or fault.kind not in (*MOMENTARY, *LASTING):
            continue
        time = _recovery(history, fault)
        if time is None:
            continue
        begin = fault.begin + time + SETTLED
        if not undisturbed(found, KINEMATICS, begin, begin + 1.0, Why.SILENT, but=fault):
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


def hung_is_replaced(history: History) -> Finding:
    """L4: a hung service is replaced within 5 s."""
    times: dict[str, list[float]] = {}
    found = effects(history)
    evidence, unknown = [], 0
    for fault in history.faults:
        lasted = fault.end - fault.begin
        if fault.kind not in HANGS or fault.target not in PROGRAMS or lasted < HUNG:
            continue
        time = _recovery(history, fault)
        until = fault.begin + (0.0 if time is None else min(time, HUNG))
        if (
            time is None
            or not undisturbed(found, fault.target, fault.begin - BEFORE, until, Why.UNWATCHED, but=fault)
            or not _is_alone(found, fault, fault.begin, until)
            or _paused(found, fault, time, HUNG)
        ):
            unknown += 1
            continue
        times.setdefault(fault.target, []).append(time)
        if time > HUNG:
            evidence.append(Evidence(fault.begin, f"{fault.target} hangs and is silent {_duration(time)}"))
    every = [time for values in times.values() for time in values]
    measured = f"replaced within {max(every):.2f} s, allowed {HUNG:g} s" if every else ""
    return Finding("L4", len(every), measured, evidence, unknown, times, max(every, default=math.nan))


def _recovery(history: History, fault: InjectedFault) -> float | None:
    """Return how long a program is silent after a fault [s]; ``None`` if it was silent before."""
    output = history.output(fault.target)
    if not _flowed(history, fault.target, fault.begin, FLOWING):
        return None
    begin = _death(history, fault)
    silent = begin + SAME
    if fault.kind in HANGS and any(life.pid == fault.pid for life in history.lives_of(fault.target)):
        # A busy machine still sends what was begun: only its successor ends the silence, or its return.
        silent = max(silent, history.effect_end(fault) - RESTARTED)
    following = [s.received for s in between(output, silent, history.end)]
    if following:
        return min(following) - begin
    # Silent for good, if the record is long enough to show it.
    return math.inf if history.end - begin > HUNG else None


def _paused(found: Sequence[Effect], fault: InjectedFault, time: float, bound: float) -> bool:
    """Return whether a silence after a fault is above a bound only because the whole machine paused."""
    missed = disturbed_for(found, ALL, fault.begin, fault.begin + time, *MISSED)
    return time > bound >= time - missed


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


def _is_alone(
    found: Sequence[Effect], fault: InjectedFault, begin: float, end: float, program: str = ""
) -> bool:
    """Return whether only this fault disturbs the return of a program (default: of the target)."""
    program = program or fault.target
    # If all were hit, those that it follows had to start as well.
    followed = [each for each, dependents in DEPENDENTS.items() if program in dependents]
    starting = (program, *followed) if fault.target == ALL else (program,)
    return undisturbed(found, program, begin, end, Why.SILENT, but=fault) and all(
        undisturbed(found, each, time, time, Why.WAITING) for each in starting for time in (begin, end)
    )


def _duration(time: float) -> str:
    return "for good" if time == math.inf else f"for {time:.2f} s"
