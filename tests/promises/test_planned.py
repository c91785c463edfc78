"""A promise that a run exercised much more seldom than planned is a failure of the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from interfaces.service.health import BY_HAND
from interfaces.topics import DIAGNOSTICS, OFF, ON
from tests.promises.findings import Evidence, Finding
from tests.promises.history import CONTROLLER, KINEMATICS, Condition, History, InjectedFault
from tests.promises.planned import planned, with_planned
from tests.promises.promises import checked, overloads

from . import histories
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


def test_too_few_cases_are_told_after_the_violations() -> None:
    late = Evidence(1.0, "too late")
    finding = with_planned(Finding("S2", 1, "", [late]), 4, END)
    assert finding.evidence == [late, Evidence(END, "the run exercised it once, and planned 4 cases")]


def test_overload_weakens_no_finding_of_too_few_cases() -> None:
    history = histories.faulty(days(lets_go=False), Condition("overload", 205.0, 206.0))
    assert overloads(history, [*checked(history)]).endswith("weakened verdicts: none")


@pytest.mark.parametrize(
    ("by_hand", "since", "due"),
    [
        (("theta1",), 0.0, 5),
        (("theta1", "theta2"), 0.0, 0),
        (("theta1", "theta2"), 45.0, 5),  # long after the release of each day
    ],
)
def test_joints_that_are_set_by_hand_make_no_case_of_s6(
    by_hand: tuple[str, ...], since: float, due: int
) -> None:
    history = days(lets_go=True, driven=True)
    health = samples(
        (at, (f"config_{name}", 7, *([(BY_HAND, "value")] if at % DAY >= since else [])))
        for at in range(round(END))
        for name in by_hand
    )
    history.streams[DIAGNOSTICS.name] = health
    assert planned(history)["S6"] == due


Times = list[tuple[float, float]]


def plan(silences: Times, faults: Sequence[InjectedFault | Condition] = ()) -> dict[str, int]:
    """Return what is planned in a record of 100 s whose engines run for 60 s."""
    conditions = [Condition("silence", *each) for each in silences]
    states = [(n / 4, ON if n < 240 else OFF) for n in range(400)]
    values = [(n / 4, float(n)) for n in range(1, 121)]
    positions = [(at, (at, 0.0)) for at, _ in values]
    return planned(
        histories.history(
            end=100.0, states=states, l1=values, positions=positions, faults=[*conditions, *faults]
        )
    )


@pytest.mark.parametrize(
    ("silences", "stops", "starts"),
    [
        ([(20.125, 31.5)], 0, 0),  # it may be too short
        ([(20.125, 31.75)], 1, 0),
        ([(20.125, 99.75)], 1, 0),
        ([(20.125, 100.0)], 0, 0),  # the record ends before its outcome
        ([(50.125, 70.0)], 1, 0),
        ([(61.0, 80.0)], 0, 0),  # the engines are off
        ([(20.125, 40.0), (50.0, 51.0)], 1, 0),  # held too shortly
        ([(20.125, 40.0), (50.25, 51.0)], 1, 1),
        ([(20.125, 25.0), (40.0, 59.0)], 1, 0),  # the engines are still on
        ([(20.125, 40.0), (45.0, 46.0), (59.0, 80.0)], 2, 0),
        ([(20.125, 40.0), (120.0, 130.0)], 1, 1),
        ([(20.125, 92.0), (120.0, 130.0)], 1, 0),  # the record ends before
    ],
)
def test_long_silence_plans_a_stop_and_what_is_held_after_it_a_start(
    silences: Times, stops: int, starts: int
) -> None:
    due = plan(silences)
    assert (due["S1"], due["S3"]) == (stops, starts)


def test_overload_is_no_silence_of_the_plan() -> None:
    assert plan([(61.0, 62.0)], [Condition("overload", 20.0, 40.0)])["S1"] == 0


@pytest.mark.parametrize(
    ("program", "at", "due"),
    [
        ("velocity", 20.0, 1),
        ("velocity", 20.125, 0),  # nobody holds the switch
        ("velocity", 39.75, 0),
        ("velocity", 40.0, 1),
        ("velocity", 45.5, 0),
        ("velocity", 61.0, 0),  # the engines are off
        (CONTROLLER, 20.0, 0),
    ],
)
def test_kill_plans_a_case_of_s2_while_the_engines_run_and_the_switch_is_held(
    program: str, at: float, due: int
) -> None:
    faults = [InjectedFault("kill", program, at, at)]
    assert plan([(20.125, 40.0), (45.0, 46.0)], faults)["S2"] == due
    assert plan([], faults)["S2"] == 0  # the plan does not show whether it is held


@pytest.mark.parametrize(
    ("kind", "program", "at", "due"),
    [
        ("kill", KINEMATICS, 20.0, 1),
        ("kill", "config_l1", 20.0, 1),
        ("terminate", "config_l1", 20.0, 1),
        ("raise", "config_l1", 20.0, 1),
        ("stop", "config_l1", 20.0, 0),
        ("kill", "velocity", 20.0, 0),
        ("kill", "config_l2", 20.0, 0),  # it has a constant
        ("kill", "config_l1", 0.0, 0),  # before its first value
        ("kill", "config_l1", 30.5, 1),
        ("kill", "config_l1", 30.75, 0),  # it stands
    ],
)
def test_end_of_a_process_plans_a_case_of_l3_if_its_values_flow(
    kind: str, program: str, at: float, due: int
) -> None:
    assert plan([], [InjectedFault(kind, program, at, at)])["L3"] == due


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
