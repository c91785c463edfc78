"""Shrinks a schedule that breaks a promise to the smallest set of faults that still does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rclpy_simulation.faults import minimal

from tests.chaos.schedule_file import Experiment
from tests.simulation.outcome import Outcome, simulate

MARGIN = 15.0  # s after the first evidence: the checkers need to see what follows


def shrink(outcome: Outcome, report: Callable[[int], None] = lambda faults: None) -> Outcome:
    """Return the outcome of a smaller experiment that breaks the first promise that this one breaks.

    :param report: receives the number of faults that are left, after each success.
    """
    promise = outcome.violated()[0]
    best = outcome

    def breaks(experiment: Experiment) -> bool:
        nonlocal best
        found = simulate(experiment)
        if promise not in found.violated():
            return False
        best = found
        report(len(experiment.faults))
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
