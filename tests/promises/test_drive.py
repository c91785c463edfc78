from __future__ import annotations

from dataclasses import replace

import pytest

from interfaces import topics
from tests.promises.drive import joints_stand_in_time
from tests.promises.findings import HOLDS, Evidence, Finding
from tests.promises.history import NO_TARGET, OVERLOAD, History, InjectedFault, Sample
from tests.promises.promises import CHECKERS

from .histories import good, silent


def samples(*pairs: tuple[float, float | bool]) -> list[Sample]:
    return [Sample(at, at, value) for at, value in pairs]


def history(
    joint: str, moves: list[tuple[float, float]], *faults: InjectedFault, has_drive: bool = True
) -> History:
    """Return a history whose operator lives from 1 s to 2 s and from 30 s on."""
    streams = {
        "operator_heartbeat": samples((1.0, True), (2.0, True), (30.0, True), (31.0, True)),
        "theta1": samples((1.0, 0.0), (40.0, 0.0)),
        "theta2": samples((1.0, 0.0), (40.0, 0.0)),
    }
    streams[joint] = samples((1.0, 0.0), *moves)
    if has_drive:
        streams["driven_time"] = samples((1.0, 0.0))
    return History(40.0, streams, [], list(faults))


@pytest.mark.parametrize("joint", ["theta1", "theta2"])
def test_s6_joint_that_stands_in_time(joint: str) -> None:
    found = joints_stand_in_time(history(joint, [(12.0, 0.25), (12.5, 0.5), (12.75, 0.75), (20.0, 0.75)]))

    assert found == Finding("S6", 1, "joints stood within 10.50 s, allowed 10.5 s", [], worst=10.5)


@pytest.mark.parametrize("joint", ["theta1", "theta2"])
def test_s6_joint_that_moves_too_late(joint: str) -> None:
    found = joints_stand_in_time(history(joint, [(12.0, 0.25), (13.0, 0.5), (13.25, 0.75)]))

    text = "a joint still moved 11.00 s after the operator's last sign of life"
    assert (found.cases, found.evidence) == (1, [Evidence(12.5, text)])


def test_s6_joint_that_was_away_may_have_moved_in_time() -> None:
    found = joints_stand_in_time(history("theta1", [(12.0, 0.25), (20.0, 0.5), (21.0, 0.5)]))

    assert (found.cases, found.evidence, found.worst) == (1, [], 10.0)


def test_s6_joint_that_stood_all_the_time_is_no_case() -> None:
    found = joints_stand_in_time(history("theta1", [(12.0, 0.0), (20.0, 0.0)]))

    assert (found.cases, found.worst) == (0, 0.0)


def test_s6_present_operator_may_move_the_joints() -> None:
    found = joints_stand_in_time(history("theta1", [(12.0, 0.25), (30.5, 0.5), (31.5, 0.75), (40.0, 1.0)]))

    assert (found.cases, found.evidence) == (0, [])


def test_s6_joint_that_moves_before_the_first_sign_of_life() -> None:
    moved = history("theta1", [])
    moved.streams["theta1"] = samples((0.25, 0.0), (0.5, 0.25))

    (evidence,) = joints_stand_in_time(moved).evidence
    assert evidence == Evidence(0.25, "a joint moved before the operator's first sign of life")

    found = joints_stand_in_time(replace(moved, faults=[InjectedFault(OVERLOAD, NO_TARGET, 0.0, 0.5)]))
    assert (found.cases, found.unknown, found.evidence) == (0, 1, [])


@pytest.mark.parametrize(("end", "expected"), [(1.9, (1, 1)), (4.0, (0, 0))])
def test_s6_operator_may_be_seen_in_an_overload(end: float, expected: tuple[int, int]) -> None:
    blind = InjectedFault(OVERLOAD, NO_TARGET, 1.5, end)
    found = joints_stand_in_time(history("theta1", [(13.0, 0.5), (13.25, 0.75)], blind))

    assert (found.cases, len(found.evidence)) == expected
    assert found.unknown == 1 - expected[0]


def test_s6_judges_every_silence() -> None:
    late = [(12.0, 0.25), (13.0, 0.5), (13.25, 0.75), (41.0, 1.0), (42.0, 1.5), (42.25, 2.0)]
    long = replace(history("theta1", late), end=60.0)
    assert [each.time for each in joints_stand_in_time(long).evidence] == [12.5, 41.5]
    assert joints_stand_in_time(long).cases == 2

    blind = [InjectedFault(OVERLOAD, NO_TARGET, at, at + 2.5) for at in (1.5, 30.5)]
    found = joints_stand_in_time(replace(long, faults=blind))
    assert (found.cases, found.unknown) == (0, 2)


def test_s6_silence_as_long_as_the_limit_is_no_case() -> None:
    short = replace(history("theta1", [(12.0, 0.25), (12.25, 0.5)]), end=12.5)
    short.streams["operator_heartbeat"] = samples((1.0, True), (2.0, True))
    assert joints_stand_in_time(short).cases == 0


def test_s6_without_a_drive_says_nothing() -> None:
    found = joints_stand_in_time(history("theta1", [(20.0, 0.5), (21.0, 0.75)], has_drive=False))

    assert (found.cases, found.evidence) == (0, [])


def test_s6_joints_of_a_good_history_move_only_with_an_operator() -> None:
    assert CHECKERS["S6"](good()).evidence == []
    assert CHECKERS["S6"](silent(good(), topics.OPERATOR_HEARTBEAT.name, 20.0, 40.0)).verdict != HOLDS
