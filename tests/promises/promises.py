"""The promises of an arm (the table in deploy/SAFETY.md), each with its checker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from tests.promises import drive, liveness, safety
from tests.promises.findings import Finding, count
from tests.promises.history import OVERLOAD, History, merged

CHECKERS: dict[str, Callable[[History], Finding]] = {
    "S1": safety.engines_off_in_time,
    "S2": safety.engines_stay_on,
    "S3": safety.turned_on_with_operator,
    "S4": safety.valid_speeds_and_positions,
    "S5": safety.single_instances,
    "S6": drive.joints_stand_in_time,
    "L1": liveness.output_resumes,
    "L2": liveness.other_streams_flow,
    "L3": liveness.right_after_restart,
    "L4": liveness.hung_is_replaced,
}


def overloads(history: History, findings: Sequence[Finding]) -> str:
    """Return how often the machine or the observer was overloaded, and which verdicts that weakens."""
    intervals = merged((each.begin, each.end) for each in history.faults if each.kind == OVERLOAD)
    if not intervals:
        return "No overload of the machine or the observer"
    rested = replace(history, faults=[fault for fault in history.faults if fault.kind != OVERLOAD])
    weaker = [each.promise for each in findings if _cases(CHECKERS[each.promise](rested)) != _cases(each)]
    seconds = sum(end - begin for begin, end in intervals)
    return (
        f"{count(len(intervals), 'overload')} of the machine or the observer, {seconds:.1f} s in all; "
        f"weakened verdicts: {', '.join(weaker) or 'none'}"
    )


def _cases(finding: Finding) -> tuple[object, ...]:
    return finding.cases, finding.unknown, finding.evidence


def meaning(promise: str) -> str:
    sentence = (CHECKERS[promise].__doc__ or "").partition(": ")[2].strip().replace("`", "")
    return sentence[:1].upper() + sentence[1:]
