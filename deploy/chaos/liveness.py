"""The liveness promises L1 to L4: pure functions from a history to a finding."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence

from deploy.chaos.findings import Evidence, Finding, percentile
from deploy.chaos.history import (
    ALL,
    CIRCUMSTANCES,
    OPERATOR,
    OUTPUTS,
    PROGRAMS,
    SENTINEL,
    Fault,
    History,
    between,
)
from deploy.chaos.safety import Published, may_have_missed_values
from interfaces import topics

MEDIAN, SLOWEST = 1.0, 2.0  # s, L1
SAMPLES = 3  # of fewer there is no median worth the name
KILLING = 1.0  # s from the monkey's decision to the death of the process
GAP = 0.25  # s, L2
HUNG = 5.0  # s, L4
GONE = 10.0  # s of silence that nothing excuses
SETTLED = 0.5  # s after a recovery until everything downstream is right
FLOWING = 1.2  # s within which a program's output came before it was hit, or it has none just now

DOWNSTREAM = {
    "kinematics": ("velocity",),
    "dead_mans_switch": ("operator_watchdog",),
    OPERATOR: ("dead_mans_switch", "operator_watchdog"),
}
"""What falls silent because its only source does."""
STEADY = tuple(program for program in OUTPUTS if program != "operator_watchdog")
"""Programs whose output comes more often than every 250 ms, as long as the operator holds the switch."""

OBSCURED = dict.fromkeys(("flood", "babble"), ("dead_mans_switch", "operator_watchdog"))
"""Whose output cannot be told from what the monkey says."""
MOMENTARY = ("kill", "terminate", "raise")
LASTING = ("stop", "hang", "hog", "crash_loop", "kill_all", "kill_supervisor")


def comes_back(history: History) -> Finding:
    """L1: after SIGKILL of any service its output flows again: p50 ≤ 1.0 s, p99 ≤ 2.0 s."""
    times: dict[str, list[float]] = {}
    evidence, unknown = [], 0
    for fault in history.faults:
        if fault.kind == "kill":
            time = _recovery(history, fault)
            if time is None or not _undisturbed(
                history, fault, fault.begin, fault.begin + min(time, SLOWEST)
            ):
                unknown += 1
                continue
            if time > SLOWEST >= time - history.missed(fault.begin, fault.begin + time):
                unknown += 1  # a pause of the whole machine
                continue
            times.setdefault(fault.target, []).append(time)
            if time > SLOWEST:
                what = f"{fault.target} is silent {_seconds(time)} after SIGKILL"
                evidence.append(Evidence(fault.begin, what))
    for program, values in times.items():
        if len(values) >= SAMPLES and (median := percentile(values, 50)) > MEDIAN:
            evidence.append(Evidence(0.0, f"{program} takes {median:.2f} s in the median"))
    evidence += _never_back(history)
    every = [time for values in times.values() for time in values]
    figures = f"p50 {percentile(every, 50):.2f} s, p99 {percentile(every, 99):.2f} s"
    return Finding("L1", len(every), figures if every else "", evidence, unknown, times)


def _never_back(history: History) -> Iterator[Evidence]:
    """Programs that say nothing any more after a fault of any kind, though nothing else holds them up."""
    for fault in history.faults:
        begin, end = fault.end, fault.end + GONE
        if fault.kind in CIRCUMSTANCES or end > history.end:
            continue
        for program in PROGRAMS if fault.target == ALL else (fault.target,):
            if program not in PROGRAMS or between(history.output(program), begin, end):
                continue
            held_up = (
                _disturbs(history, other, source, begin, end)
                for other in history.faults
                if other is not fault
                for source in (program, *_sources(program))
            )
            if not any(held_up):
                yield Evidence(end, f"{program} says nothing for {GONE:g} s after {fault.kind}")


def _sources(program: str) -> list[str]:
    return [source for source, targets in DOWNSTREAM.items() if program in targets]


def others_flow_on(history: History) -> Finding:
    """L2: the streams of the other services show no gap over 250 ms meanwhile."""
    evidence, cases, unknown, longest = [], 0, 0, 0.0
    for fault in history.faults:
        if fault.kind != "kill":
            continue
        end = min(fault.begin + min(_recovery(history, fault) or SLOWEST, SLOWEST), history.end - GAP)
        others = [p for p in STEADY if p not in (fault.target, *DOWNSTREAM.get(fault.target, ()))]
        for program in others:
            if not _flowed(history, program, fault.begin, GAP):
                continue
            if any(
                _disturbs(history, other, program, fault.begin - 1.0, end + GAP) for other in history.faults
            ):
                continue
            excused = 0
            for one, two in _pauses(history, program, fault.begin - GAP, end):
                if two - one > GAP and _overloaded(history, one, two, others):
                    excused = 1
                    continue
                longest = max(longest, two - one)
                if two - one > GAP:
                    what = f"{program} is silent for {two - one:.2f} s when {fault.target} is killed"
                    evidence.append(Evidence(one, what))
            cases += 1 - excused
            unknown += excused
    figures = f"longest gap {1000 * longest:.0f} ms of {1000 * GAP:.0f} ms"
    return Finding("L2", cases, figures, evidence, unknown)


def _pauses(history: History, program: str, begin: float, end: float) -> Iterator[tuple[float, float]]:
    """From each message that a program sent between two times to its next one, or to the record's end."""
    output = history.output(program)
    first = bisect_left(output, begin, key=lambda s: s.sent)
    last = bisect_right(output, end, key=lambda s: s.sent)
    following = output[last].sent if last < len(output) else history.end
    return itertools.pairwise([*(s.sent for s in output[first:last]), following])


def _overloaded(history: History, begin: float, end: float, programs: Sequence[str]) -> bool:
    """Whether all but a gap is what the observer may have missed, or most of the streams paused with it."""
    paused = sum(not between(history.output(program), begin + 0.02, end - 0.02) for program in programs)
    return end - begin - history.missed(begin, end) <= GAP or 2 * paused > len(programs)


def right_after_return(history: History) -> Finding:
    """L3: what changed while a service was dead is right after its return."""
    published = Published(history)
    evidence, cases, unknown = [], 0, 0
    concerned = ("kinematics", *(topics.CONFIGURATION[name].publishers[0] for name in topics.CONFIGURATION))
    for fault in history.faults:
        if fault.target not in concerned or fault.kind not in (*MOMENTARY, *LASTING):
            continue
        time = _recovery(history, fault)
        if time is None or time == math.inf:
            continue
        begin = fault.begin + time + SETTLED
        if any(
            _disturbs(history, other, "kinematics", begin, begin + 1.0)
            for other in history.faults
            if other is not fault
        ):
            continue
        positions = between(history.stream(topics.EFFECTOR_POSITION), begin, begin + 1.0)
        right = bool(positions) and published.explains(positions[-1], within=SETTLED)
        if positions and not right and may_have_missed_values(history, positions[-1].sent):
            unknown += 1
            continue
        cases += bool(positions)
        if positions and not right:
            what = f"the position is not that of the last values after {fault.kind} of {fault.target}"
            evidence.append(Evidence(positions[-1].sent, what))
    return Finding("L3", cases, f"right after {cases - len(evidence)} of {cases} returns", evidence, unknown)


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
        replaced_itself = any(
            other.target in (SENTINEL, ALL) and other.overlaps(fault.begin - 1.0, until + 0.001)
            for other in history.faults
            if other is not fault
        )
        if time is None or replaced_itself or not _undisturbed(history, fault, fault.begin, until):
            unknown += 1
            continue
        times.setdefault(fault.target, []).append(time)
        if time > HUNG:
            evidence.append(Evidence(fault.begin, f"{fault.target} hangs, silent {_seconds(time)}"))
    every = [time for values in times.values() for time in values]
    figures = f"replaced after {max(every):.2f} s at most" if every else ""
    return Finding("L4", len(every), figures, evidence, unknown, times)


def _recovery(history: History, fault: Fault) -> float | None:
    """How long a program was silent after a fault; infinite if for good; None if it had nothing to say."""
    output = history.output(fault.target)
    if not _flowed(history, fault.target, fault.begin, FLOWING):
        return None
    begin = _death(history, fault)
    following = [s.received for s in between(output, begin + 0.01, history.end)]
    if following:
        return min(following) - begin
    # Nothing came: for good, if the record lasts long enough to say so.
    return math.inf if history.end - begin > HUNG else None


def _death(history: History, fault: Fault) -> float:
    """When a process ended that was killed; otherwise when the fault began."""
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


def _undisturbed(history: History, fault: Fault, begin: float, end: float) -> bool:
    """Whether nothing else kept the program from its output."""
    return not any(
        _disturbs(history, other, program, begin, end)
        for other in history.faults
        if other is not fault
        for program in (fault.target, *_sources(fault.target))
    )


def _disturbs(history: History, fault: Fault, program: str, begin: float, end: float) -> bool:
    """Whether a fault, or the recovery from it, concerns a program's output within a time."""
    recovery = HUNG if fault.kind in LASTING else SLOWEST
    if history.ended(fault) + recovery < begin or fault.begin > end:
        return False
    concerned = (fault.target, *DOWNSTREAM.get(fault.target, ()), *OBSCURED.get(fault.kind, ()))
    return program in concerned or fault.target == ALL


def _seconds(time: float) -> str:
    return "for good" if time == math.inf else f"{time:.2f} s"
