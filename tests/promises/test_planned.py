"""A promise that a run exercised much more seldom than planned is a failure of the run."""

from __future__ import annotations

from dataclasses import replace

import pytest

from interfaces.topics import OFF, ON
from tests.promises.findings import Evidence, Finding
from tests.promises.history import CONTROLLER, KINEMATICS, Condition, History, InjectedFault
from tests.promises.planned import planned, with_planned
from tests.promises.promises import checked

from .histories import samples

END = 300.0
DAY = 50.0
AWAKE = 30.0
"""In each day of 50 s, the operator holds the switch for 30 s."""
SILENCES = [Condition("silence", DAY * n + AWAKE, DAY * (n + 1)) for n in range(round(END / DAY))]

NO_FAULTS = dict.fromkeys(("S2", "S5", "S6", "L2", "L3"), 0)


def days(*, lets_go: bool, faults: list[InjectedFault] | None = None, driven: bool = False) -> History:
    """Return a record in which the engines turn off 10 s after a release that the switch shows."""
    times = [n / 10 for n in range(round(10 * END))]
    beats = [(at, True) for at in times if not lets_go or at % DAY < AWAKE]
    states = [(at, ON if not lets_go or 1.0 < at % DAY < AWAKE + 9.9 else OFF) for at in times]
    streams = {"operator_heartbeat": samples(beats), "engines/state": samples(states)}
    if driven:
        streams["effector/position"] = samples((at, (at, 0.0)) for at in times)
        streams["l1"] = samples((at, at) for at in times if at < 69.0)
        streams["driven_time"] = samples((at, (at, "robot")) for at in times)
    return History(END, streams, faults=faults or [], conditions=SILENCES)


def too_few(history: History) -> dict[str, Evidence]:
    """Return the evidence of too few cases, by promise."""
    return {
        finding.promise: each
        for finding in checked(history)
        for each in finding.evidence
        if "planned" in each.text
    }


def test_switch_that_never_lets_go_leaves_s1_without_its_cases() -> None:
    found = too_few(days(lets_go=False))
    assert found["S1"] == Evidence(END, "the run exercised it 0 times, and planned 5 cases")
    assert "S1" not in too_few(days(lets_go=True))


def test_engines_that_never_turn_on_leave_s3_without_its_cases() -> None:
    history = days(lets_go=True)
    states = history.streams["engines/state"]
    history.streams["engines/state"] = samples((each.sent, OFF) for each in states)
    assert {*too_few(history)} == {"S3"}


@pytest.mark.parametrize(
    ("cases", "unknown", "due", "fails"),
    [
        (1, 0, 4, True),
        (2, 0, 4, False),
        (1, 1, 4, False),
        (0, 0, 3, False),
        (3, 0, 7, True),
        (4, 0, 7, False),
    ],
)
def test_half_of_at_least_four_planned_cases_is_enough(
    cases: int, unknown: int, due: int, fails: bool
) -> None:
    finding = with_planned(Finding("S2", cases, "", [], unknown), due, END)
    assert bool(finding.evidence) == fails


def test_plan_of_a_run_that_was_shortened_ends_with_it() -> None:
    assert planned(replace(days(lets_go=True), end=130.0)) == {**NO_FAULTS, "S1": 2, "S3": 2}


def test_plan_counts_faults_and_releases() -> None:
    faults = [
        InjectedFault("kill", KINEMATICS, 10.0, 10.0, 5),
        InjectedFault("kill", KINEMATICS, 35.0, 35.0, 5),  # nobody holds the switch
        InjectedFault("kill", KINEMATICS, 50.5, 50.5, 0),  # it has no process, and the engines are off
        InjectedFault("kill", CONTROLLER, 60.0, 60.0, 6),
        InjectedFault("raise", "config_l1", 69.0, 69.0, 7),
        InjectedFault("raise", "config_l1", 75.0, 75.0, 8),  # it stands
        InjectedFault("raise", "config_l2", 69.0, 69.0, 9),  # it has a constant
        InjectedFault("stop", "config_l1", 80.0, 90.0, 7),
    ]
    assert planned(days(lets_go=True, faults=faults, driven=True)) == {
        "S1": 5,  # the last silence ends with the record
        "S2": 1,
        "S3": 5,
        "S5": 3,
        "S6": 5,
        "L2": 12,
        "L3": 4,
    }
