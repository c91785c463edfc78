from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from interfaces import topics
from interfaces.service.health import BY_HAND, FASTEST
from tests.promises.drive import AT_ONCE
from tests.promises.findings import HOLDS, Evidence, Finding
from tests.promises.history import OVERLOAD, Condition, History, Sample
from tests.promises.promises import CHECKERS

from .histories import good, silent


def samples(*pairs: tuple[float, float | bool]) -> list[Sample]:
    return [Sample(at, at, value) for at, value in pairs]


def history(
    joint: str, moves: list[tuple[float, float]], *overloads: Condition, has_drive: bool = True
) -> History:
    """Return a history whose operator lives from 1 s to 2 s and from 30 s on."""
    streams = {
        "operator_heartbeat": samples((1.0, True), (2.0, True), (30.0, True), (31.0, True)),
        "theta1": samples((1.0, 0.0), (40.0, 0.0)),
        "theta2": samples((1.0, 0.0), (40.0, 0.0)),
    }
    streams[joint] = samples((1.0, 0.0), *moves)
    if has_drive:
        streams["driven_time"] = samples((1.0, (0.0, "host")))
    return History(40.0, streams, conditions=[*overloads])


@pytest.mark.parametrize("joint", ["theta1", "theta2"])
def test_s6_joint_that_stands_in_time(joint: str) -> None:
    found = CHECKERS["S6"](history(joint, [(12.0, 0.25), (12.5, 0.5), (12.75, 0.75), (20.0, 0.75)]))

    assert found == Finding("S6", 1, "joints stood within 10.50 s, allowed 10.5 s", [], worst=10.5)


@pytest.mark.parametrize("joint", ["theta1", "theta2"])
def test_s6_joint_that_moves_too_late(joint: str) -> None:
    found = CHECKERS["S6"](history(joint, [(12.0, 0.25), (13.0, 0.5), (13.25, 0.75)]))

    text = "a joint still moved 11.00 s after the operator's last sign of life"
    assert (found.cases, found.evidence) == (1, [Evidence(12.5, text)])


def test_s6_joint_that_was_away_may_have_moved_in_time() -> None:
    found = CHECKERS["S6"](history("theta1", [(12.0, 0.25), (20.0, 0.5), (21.0, 0.5)]))

    assert (found.cases, found.evidence, found.worst) == (1, [], 10.0)


def test_s6_joint_that_stood_all_the_time_is_no_case() -> None:
    found = CHECKERS["S6"](history("theta1", [(12.0, 0.0), (20.0, 0.0)]))

    assert (found.cases, found.worst) == (0, 0.0)


def test_s6_present_operator_may_move_the_joints() -> None:
    found = CHECKERS["S6"](history("theta1", [(12.0, 0.25), (30.5, 0.5), (31.5, 0.75), (40.0, 1.0)]))

    assert (found.cases, found.evidence) == (0, [])


def test_s6_joint_that_moves_before_the_first_sign_of_life() -> None:
    moved = history("theta1", [])
    moved.streams["theta1"] = samples((0.25, 0.0), (0.5, 0.25))

    (evidence,) = CHECKERS["S6"](moved).evidence
    assert evidence == Evidence(0.25, "a joint moved before the operator's first sign of life")

    found = CHECKERS["S6"](replace(moved, conditions=[Condition(OVERLOAD, 0.0, 0.5)]))
    assert (found.cases, found.unknown, found.evidence) == (0, 1, [])


@pytest.mark.parametrize(("end", "expected"), [(1.9, (1, 1)), (4.0, (0, 0))])
def test_s6_operator_may_be_seen_in_an_overload(end: float, expected: tuple[int, int]) -> None:
    blind = Condition(OVERLOAD, 1.5, end)
    found = CHECKERS["S6"](history("theta1", [(13.0, 0.5), (13.25, 0.75)], blind))

    assert (found.cases, len(found.evidence)) == expected
    assert found.unknown == 1 - expected[0]


def test_s6_judges_every_silence() -> None:
    late = [(12.0, 0.25), (13.0, 0.5), (13.25, 0.75), (41.0, 1.0), (42.0, 1.5), (42.25, 2.0)]
    long = replace(history("theta1", late), end=60.0)
    assert [each.time for each in CHECKERS["S6"](long).evidence] == [12.5, 41.5]
    assert CHECKERS["S6"](long).cases == 2

    blind = [Condition(OVERLOAD, at, at + 2.5) for at in (1.5, 30.5)]
    found = CHECKERS["S6"](replace(long, conditions=blind))
    assert (found.cases, found.unknown) == (0, 2)


def test_s6_silence_as_long_as_the_limit_is_no_case() -> None:
    short = replace(history("theta1", [(12.0, 0.25), (12.25, 0.5)]), end=12.5)
    short.streams["operator_heartbeat"] = samples((1.0, True), (2.0, True))
    assert CHECKERS["S6"](short).cases == 0


def test_s6_without_a_drive_says_nothing() -> None:
    found = CHECKERS["S6"](history("theta1", [(20.0, 0.5), (21.0, 0.75)], has_drive=False))

    assert (found.cases, found.evidence) == (0, [])


# Jumps, while the operator lives


def jumping(
    *moves: tuple[float, float], reports: tuple[tuple[float, dict[str, Any]], ...] = (), alive: bool = True
) -> Finding:
    """Judge a joint that stood at 0 rad.

    :param reports: when its source reported its health, and what of the movement; by default at most
        0.5 rad/s.
    :param alive: whether the operator lives.
    """
    reports = reports or tuple((float(at), {FASTEST: 0.5}) for at in range(40))
    beats = samples(*((at / 4.0, True) for at in range(160))) if alive else samples((0.0, True))
    streams = {
        "driven_time": samples((1.0, (0.0, "host"))),
        "operator_heartbeat": beats,
        "theta1": samples((1.0, 0.0), *moves),
        "theta2": samples((1.0, 0.0)),
        "/diagnostics": [Sample(at, at, ("config_theta1", 7, *each.items())) for at, each in reports],
    }
    return CHECKERS["S6"](History(40.0, streams))


def texts(found: Finding) -> list[str]:
    return [each.text for each in found.evidence]


def test_s6_joint_that_jumps_while_the_operator_lives() -> None:
    found = jumping((10.0, 0.0), (10.04, 1.0))

    assert found.evidence == [
        Evidence(10.04, "theta1 jumped: 1.00 rad in 0.04 s, at most 0.32 is right"),
    ]


def test_s6_joint_that_jumps_between_two_drives() -> None:
    found = jumping(*((10.0 + at / 50.0, 0.1 * (at % 2)) for at in range(200)))

    assert len(found.evidence) == 4
    assert all(9.9 < each.time < 14.0 for each in found.evidence)


def test_s6_jump_between_the_late_moves_is_reported_too() -> None:
    found = jumping((20.0, 0.0), (20.04, 1.0), (20.5, 0.0), alive=False)

    assert sorted(each.split()[0] for each in texts(found)) == ["a", "theta1"]


def test_s6_joint_that_moves_as_its_scenario_is_right() -> None:
    assert jumping(*((10.0 + at / 25.0, 0.02 * at) for at in range(250))).evidence == []


def test_s6_joint_that_was_away_or_waited_may_catch_up() -> None:
    assert jumping((10.0, 0.0), (14.0, 2.0), (14.04, 2.2)).evidence == []


def test_s6_first_value_of_a_scenario_is_no_jump() -> None:
    assert jumping((1.04, 0.0), (1.08, 0.02)).evidence == []
    first = jumping(reports=((2.0, {FASTEST: 0.5}),))  # before the first report, it may be set by hand
    assert first.evidence == []
    assert jumping((1.5, 2.0), reports=((2.0, {FASTEST: 0.5}), (3.0, {FASTEST: 0.5}))).evidence == []


def test_s6_joint_that_is_set_by_hand_may_jump() -> None:
    reports = tuple((float(at), {BY_HAND: "value"} if 20 <= at < 30 else {FASTEST: 0.5}) for at in range(40))
    moves = (19.5, 0.0), (19.54, 3.0), (25.0, -3.0), (29.2, 0.0), (29.24, 0.02)
    assert jumping(*moves, reports=reports).evidence == []
    assert jumping(*moves, reports=reports, alive=False).evidence == []
    assert len(jumping(*moves).evidence) == 3


def test_s6_joint_that_jumps_before_or_after_a_hand_is_found() -> None:
    reports = tuple((float(at), {BY_HAND: "value"} if 20 <= at < 30 else {FASTEST: 0.5}) for at in range(40))
    found = jumping((10.0, 0.0), (10.04, 3.0), (35.0, 3.0), (35.04, 0.0), reports=reports)
    assert [each.time for each in found.evidence] == [10.04, 35.04]


BY_HAND_UNTIL_20 = tuple((float(at), {BY_HAND: "value"} if at <= 20 else {FASTEST: 0.5}) for at in range(40))
BY_HAND_FROM_20 = tuple((float(at), {BY_HAND: "value"} if at >= 20 else {FASTEST: 0.5}) for at in range(40))


@pytest.mark.parametrize(
    ("reports", "at", "found"),
    [
        (BY_HAND_UNTIL_20, 20.5, 0),
        (BY_HAND_UNTIL_20, 21.5, 1),
        (BY_HAND_FROM_20, 19.5, 0),
        (BY_HAND_FROM_20, 18.5, 1),
        (((1.0, {BY_HAND: "value"}), (2.0, {FASTEST: 0.5})), 1.5, 0),
        (((1.0, {FASTEST: 0.5}), (2.0, {FASTEST: 0.5})), 1.5, 1),
        (((1.0, {FASTEST: 0.5}),), 1.5, 0),
        (((2.0, {FASTEST: 0.5}),), 1.5, 0),
    ],
)
def test_s6_jump_is_judged_by_the_reports_around_it(
    reports: tuple[tuple[float, dict[str, Any]], ...], at: float, found: int
) -> None:
    assert len(jumping((at - 0.04, 0.0), (at, 3.0), reports=reports).evidence) == found


def test_s6_path_as_long_as_the_limit_is_no_jump() -> None:
    one = tuple((float(at), {FASTEST: 1.0}) for at in range(40))
    assert jumping((10.0, 0.0), (10.5, 0.5 + AT_ONCE), reports=one).evidence == []
    assert len(jumping((10.0, 0.0), (10.5, 0.501 + AT_ONCE), reports=one).evidence) == 1


def test_s6_jumps_are_reported_once_in_a_second() -> None:
    found = jumping((10.0, 0.0), (10.25, 0.05), (10.5, 2.0), (10.75, 0.0), (11.5, 2.0), (20.0, 2.0))
    assert [each.time for each in found.evidence] == [10.5, 11.5]


def test_s6_steps_of_a_scenario_are_no_jumps() -> None:
    steps = tuple((float(at), {FASTEST: math.inf}) for at in range(40))
    assert jumping((10.0, 0.0), (10.04, 3.0), reports=steps).evidence == []


def test_s6_joint_of_another_scenario_moves_as_fast_as_that() -> None:
    restarted = tuple((float(at), {FASTEST: 0.5 if at < 20 else 50.0}) for at in range(40))
    assert jumping((20.5, 0.0), (20.54, 3.0), reports=restarted).evidence == []
    assert len(jumping((15.5, 0.0), (15.54, 3.0), reports=restarted).evidence) == 1


def test_s6_joints_of_a_good_history_move_only_with_an_operator() -> None:
    assert CHECKERS["S6"](good()).evidence == []
    assert CHECKERS["S6"](silent(good(), topics.OPERATOR_HEARTBEAT.name, 20.0, 40.0)).verdict != HOLDS
