"""Bugs that break a claim of deploy/SAFETY.md, and no bound of a promise: each is found in one short play."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import pytest

from interfaces.topics import TURN_ON
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.history import CONTROLLER, DRIVE, KINEMATICS, WATCHDOG
from tests.promises.text_report import text
from tests.simulation import people
from tests.simulation.bugs import Bug, planted
from tests.simulation.outcome import simulate

HELD, STRIKE = 3.0, 4.4  # s


class Case(NamedTuple):
    bug: Bug
    pressed: Sequence[tuple[float, float]]
    commands: Sequence[float]
    """Times at which the operator turns the engines on."""
    faults: Sequence[PlannedFault]
    promise: str
    text: str
    last_line: str = ""
    """Of the process that ends by itself."""


def holds(number: int) -> list[tuple[float, float]]:
    """Return so many holds of the switch, with a strike between any two of them."""
    begins = [n * (HELD + STRIKE) for n in range(number)]
    return [(begin, begin + HELD) for begin in begins]


CASES = {
    "the drive forgets its time": Case(
        Bug(DRIVE, 'settings.recall("time", 0.0)', "0.0"),
        [(0.0, 20.0)],
        [1.5],
        [PlannedFault(8.0, "kill", DRIVE)],
        "S6",
        "the driven time goes back by ",
    ),
    "the drive is deaf to off": Case(
        Bug(DRIVE, "(unopposed(states).map", '(states.filter(lambda it: it.name == "on").map'),
        [(0.0, 4.0)],
        [1.5],
        [],
        "S6",
        "the drive runs ",
    ),
    "a service ends by itself": Case(
        Bug(
            KINEMATICS,
            "positions = effector_position(l1, l2, theta1, theta2)",
            "positions = effector_position(l1, l2, theta1, theta2).merge("
            "rx.timer(9.0).flat_map(lambda _: rx.throw(MemoryError())))",
        ),
        [(0.0, 20.0)],
        [1.5],
        [],
        "L4",
        " of kinematics ended without a cause",
        " s: MemoryError",
    ),
    "a restarted reader misses a constant": Case(
        Bug(
            KINEMATICS,
            "(node.observe, (L1, L2,",
            "(node.observe, (L1, __import__('dataclasses').replace(L2, qos=10),",
        ),
        [(0.0, 20.0)],
        [1.5],
        [PlannedFault(8.0, "kill", KINEMATICS)],
        "L1",
        "kinematics is silent for good after SIGKILL",
    ),
    "strikes reset when the operator returns": Case(
        Bug(WATCHDOG, ".timeout(parameters.silence)", ".timeout(parameters.silence * parameters.strikes)"),
        [*holds(3), (3 * (HELD + STRIKE), 30.0)],
        [1.5],
        [],
        "S1",
        "3 silences since 2.95 s have not turned the engines off",
    ),
    "the operator never returns": Case(
        Bug(WATCHDOG, "alive.take(1).start_with(Activity(I", "rx.never().start_with(Activity(I"),
        [(0.0, 3.0), (16.0, 30.0)],
        [1.5, 20.0],
        [],
        "S3",
        "a turn_on of a present operator turned nothing on, and the operator was not reported",
    ),
    "the controller never turns on": Case(
        Bug(CONTROLLER, "why_refused(event, parameters.max_presence_age)", "why_refused(event, 0.0)"),
        [(0.0, 20.0)],
        [8.0],
        [],
        "S3",
        "a turn_on of a present operator turned nothing on, although the operator was reported",
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_bug_that_breaks_a_claim_is_found(case: Case) -> None:
    scenario: dict[str, Any] = {
        **people.sources(people.RATE),
        "l1": 2.0,
        "l2": 3.0,  # constants, which are published once
        "operator": {"pressed": [{"from": begin, "to": end} for begin, end in case.pressed]},
        "engines": [{"at": at, "command": TURN_ON} for at in case.commands],
    }
    experiment = Experiment("claim", case.pressed[-1][1] + 2.0, scenario, list(case.faults))
    assert simulate(experiment).violated() == []
    with planted(case.bug):
        outcome = simulate(experiment)
    found = {finding.promise: finding.evidence for finding in outcome.findings}
    assert any(case.text in each.text for each in found[case.promise])
    report = text(outcome.findings, outcome.history)
    assert ("ended by itself at" in report) is bool(case.last_line)
    assert case.last_line in report
