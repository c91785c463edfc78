"""Shrinks a schedule that breaks a promise to the smallest set of faults that still does.

Source: A. Zeller, R. Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002 (ddmin).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from tests.chaos.schedule_file import Experiment
from tests.simulation.outcome import Outcome, simulate

T = TypeVar("T")
MARGIN = 15.0  # s after the first evidence: the checkers need to see what follows


def minimal(items: Sequence[T], fails: Callable[[Sequence[T]], bool]) -> Sequence[T]:
    """Return a part of the items that fails, and no longer does without any one of them."""
    parts = 2
    while len(items) >= 2:
        size = -(-len(items) // parts)
        chunks = [items[begin : begin + size] for begin in range(0, len(items), size)]
        rests = [
            [each for other in chunks if other is not chunk for each in other] for chunk in chunks
        ]  # of two chunks, each is the other's rest
        smaller = next((rest for rest in rests if fails(rest)), None)
        if smaller is not None:
            items, parts = smaller, max(parts - 1, 2)
        elif size == 1:
            break
        else:
            parts = min(2 * parts, len(items))
    return [] if len(items) == 1 and fails([]) else items


def shrink(outcome: Outcome, tell: Callable[[int], None] = lambda faults: None) -> Outcome:
    """Return the outcome of a smaller experiment that breaks the first promise that this one breaks.

    :param tell: receives the number of faults that are left, after each success.
    """
    promise = outcome.violated()[0]
    best = outcome

    def breaks(experiment: Experiment) -> bool:
        nonlocal best
        found = simulate(experiment)
        if promise not in found.violated():
            return False
        best = found
        tell(len(experiment.faults))
        return True

    at = min(
        each.time for finding in outcome.findings for each in finding.evidence if finding.promise == promise
    )
    until = replace(
        outcome.experiment,
        length=min(outcome.experiment.length, round(at + MARGIN, 3)),
        faults=[each for each in outcome.experiment.faults if each.at <= at],
    )
    whole = until if breaks(until) else outcome.experiment
    minimal(whole.faults, lambda faults: breaks(replace(whole, faults=list(faults))))
    return best
