"""The checkers of the liveness promises L1 to L4: pure functions from a history to a finding."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator

from deploy.promises.findings import Evidence, Finding, count, percentile
from deploy.promises.history import (
    ALL,
    DEPENDENTS,
    KINEMATICS,
    NEEDED_AT_START,
    OUTPUTS,
    PARTITION,
    PROGRAMS,
    REDISCOVERY,
    SOURCES,
    SWITCH,
    History,
    InjectedFault,
    between,
)
from deploy.promises.limits import GAP, GONE, HUNG, MEDIAN, SLOWEST
from deploy.promises.positions import PublishedValues, may_have_missed_values, may_have_reached_only_some
from interfaces import topics

SAMPLES = 3  # the least number of cases for a median
KILLING = 1.0  # s from the injection to the death of the process
SETTLED = 0.5  # s after a recovery until all programs downstream are right
FLOWING = 1.2  # s before a fault in which a program must have had output, or the fault is no case

SENTINEL = "sentinel"  # replaces hung processes
STREAMS = tuple(program for program, topic in OUTPUTS.items() if topic.longest_gap <= GAP)
OBSCURED = dict.fromkeys(("flood", "babble"), (SWITCH, *DEPENDENTS[SWITCH]))
"""The programs whose output cannot be distinguished from injected messages, by kind of fault."""
MOMENTARY = ("kill", "terminate", "raise")
LASTING = ("stop", "hang", "hog", "slow", "crash_loop", "kill_all", "kill_supervisor")


def output_resumes(history: History) -> Finding:
    """L1: after SIGKILL of any service its output flows again: p50 ≤ 1.0 s, p99 ≤ 2.0 s."""
    times: dict[str, list[float]] = {}
    evidence, unknown = [], 0
    for fault in _kills(history):
        time = _recovery(history, fault)
        if (
            time is None
            or _is_disturbed(history, fault, fault.begin, fault.begin + min(time, SLOWEST))
            or any(_paused(history, fault, time, bound) for bound in (MEDIAN, SLOWEST))
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
    evidence += _silent_for_good(history)
    every = [time for values in times.values() for time in values]
    measured = f"p50 {percentile(every, 50):.2f} s, p99 {percentile(every, 99):.2f} s" if every else ""
    return Finding("L1", len(every), measured, evidence, unknown, times, max(every, default=math.nan))


def _kills(history: History) -> Iterator[InjectedFault]:
    return (fault for fault in history.faults if fault.kind == "kill")


def _silent_for_good(history: History) -> Iterator[Evidence]:
    """Yield programs without output after a fault of any kind, unless another fault explains it."""
    for fault in history.injected:
        begin, end = fault.end, fault.end + GONE
        if end > history.end:
            continue
        for program in PROGRAMS if fault.target == ALL else (fault.target,):
            if (
                program not in PROGRAMS
                or program in history.absent
                or between(history.output(program), begin, end)
            ):
                continue
            if not _is_disturbed(history, fault, begin, end, program):
                yield Evidence(end, f"{program} is silent for {GONE:g} s after {fault.kind}")


def other_streams_flow(history: History) -> Finding:
    """L2: meanwhile the other services' streams show no gap over 250 ms."""
    evidence, cases, unknown, longest = [], 0, 0, 0.0
    for fault in _kills(history):
        end = fault.begin + min(_recovery(history, fault) or SLOWEST, SLOWEST)
        for program in STREAMS:
            if not _flowed(history, program, fault.begin, GAP):
                continue
            if any(_disturbs(history, f, program, fault.begin - 1.0, end + GAP) for f in history.faults):
                continue
            excused = 0
            for one, two in _intervals(history, program, fault.begin - GAP, end):
                if two - one > GAP >= two - one - history.missed(one, two):
                    excused = 1  # the observer may have missed messages
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
    published = PublishedValues(history)
    evidence, cases, unknown = [], 0, 0
    for fault in history.faults:
        if fault.target not in (KINEMATICS, *SOURCES) or fault.kind not in (*MOMENTARY, *LASTING):
            continue
        time = _recovery(history, fault)
        if time is None:
            continue
        begin = fault.begin + time + SETTLED
        others = (other for other in history.faults if other is not fault)
        if any(_disturbs(history, other, KINEMATICS, begin, begin + 1.0) for other in others):
            continue
        positions = between(history.stream(topics.EFFECTOR_POSITION), begin, begin + 1.0)
        right = bool(positions) and published.explain(positions[-1], within=SETTLED)
        if positions and not right and _is_undecided(history, positions[-1].sent):
            unknown += 1
            continue
        cases += bool(positions)
        if positions and not right:
            text = f"the position does not follow from the last values after {fault.kind} of {fault.target}"
            evidence.append(Evidence(positions[-1].sent, text))
    measured = f"right after {cases - len(evidence)} of {count(cases, 'return')}"
    return Finding("L3", cases, measured, evidence, unknown)


def _is_undecided(history: History, time: float) -> bool:
    """Return whether the observer and kinematics may have received different values before a time."""
    return may_have_missed_values(history, time) or may_have_reached_only_some(history, time)


def hung_is_replaced(history: History) -> Finding:
    """L4: a hung service is replaced within 5 s."""
    times: dict[str, list[float]] = {}
    evidence, unknown = [], 0
    for fault in history.faults:
        lasted = fault.end - fault.begin
        if fault.kind not in ("stop", "hang") or fault.target not in PROGRAMS or lasted < HUNG:
            continue
        time = _recovery(history, fault)
        until = fault.begin + (0.0 if time is None else min(time, HUNG))
        sentinel_was_hit = any(
            other.target in (SENTINEL, ALL) and other.overlaps(fault.begin - 1.0, until + 0.001)
            for other in history.faults
            if other is not fault
        )
        # It does not know yet how long the others have been silent.
        sentinel_was_new = fault.target != SENTINEL and any(
            fault.begin - 1.0 < life.began < until for life in history.lives_of(SENTINEL)
        )
        if (
            time is None
            or sentinel_was_hit
            or sentinel_was_new
            or _is_disturbed(history, fault, fault.begin, until)
            or _paused(history, fault, time, HUNG)
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
    following = [s.received for s in between(output, begin + 0.01, history.end)]
    if following:
        return min(following) - begin
    # Silent for good, if the record is long enough to show it.
    return math.inf if history.end - begin > HUNG else None


def _paused(history: History, fault: InjectedFault, time: float, bound: float) -> bool:
    """Return whether a silence after a fault is above a bound only because the whole machine paused."""
    return time > bound >= time - history.missed(fault.begin, fault.begin + time)


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


def _is_disturbed(
    history: History, fault: InjectedFault, begin: float, end: float, program: str = ""
) -> bool:
    """Return whether another fault disturbs a program's return (default: the target's)."""
    program = program or fault.target
    needed = [source for source, dependents in DEPENDENTS.items() if program in dependents]
    # If all were hit, those that it follows had to start as well.
    starting = (program, *needed) if fault.target == ALL else (program,)
    silent = (
        not _flowed(history, source, time, FLOWING)
        for each in starting
        for source in NEEDED_AT_START.get(each, ())
        for time in (begin, end)
    )
    return any(silent) or any(
        _disturbs(history, other, each, begin, end)
        for other in history.faults
        if other is not fault
        for each in (program, *needed)
    )


def _disturbs(history: History, fault: InjectedFault, program: str, begin: float, end: float) -> bool:
    """Return whether a fault, or the recovery from it, affects a program's output between two times."""
    recovery = HUNG if fault.kind in LASTING else REDISCOVERY if fault.kind == PARTITION else SLOWEST
    if history.effect_end(fault) + recovery < begin or fault.begin > end:
        return False
    affected = (fault.target, *DEPENDENTS.get(fault.target, ()), *OBSCURED.get(fault.kind, ()))
    return program in affected or fault.target == ALL


def _duration(time: float) -> str:
    return "for good" if time == math.inf else f"for {time:.2f} s"
