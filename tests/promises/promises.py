"""The promises of an arm (the table in deploy/SAFETY.md), each with its checker."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from tests.promises import drive, liveness, safety
from tests.promises.effects import Effect, effects
from tests.promises.findings import Finding, count
from tests.promises.history import OVERLOAD, History, merged
from tests.promises.planned import planned, with_planned

Checker = Callable[[History, Sequence[Effect]], Finding]
_CHECKERS: dict[str, Checker] = {
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


def checked(history: History) -> Iterator[Finding]:
    """Yield the finding of each checker. What excuses a violation is computed once.

    A promise that was exercised much more seldom than planned is violated as well.
    """
    found, due = effects(history), planned(history)
    for promise, check in _CHECKERS.items():
        yield with_planned(check(history, found), due.get(promise, 0), history.end)


def _alone(check: Checker) -> Callable[[History], Finding]:
    @functools.wraps(check)
    def alone(history: History) -> Finding:
        return check(history, effects(history))

    return alone


CHECKERS = {promise: _alone(check) for promise, check in _CHECKERS.items()}
"""For one promise: its checker, of a history."""


def overloads(history: History, findings: Sequence[Finding]) -> str:
    """Return how often the machine or the observer was overloaded, and which verdicts that weakens."""
    intervals = merged((each.begin, each.end) for each in history.conditions if each.kind == OVERLOAD)
    if not intervals:
        return "No overload of the machine or the observer"
    rested = replace(history, conditions=[each for each in history.conditions if each.kind != OVERLOAD])
    again = {each.promise: _cases(each) for each in checked(rested)}
    weaker = [each.promise for each in findings if again[each.promise] != _cases(each)]
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
