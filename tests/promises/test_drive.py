from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from interfaces import topics
from interfaces.service.health import BY_HAND, FASTEST
from tests.promises.drive import AT_ONCE
from tests.promises.findings import HOLDS, Evidence, Finding
from tests.promises.history import OVERLOAD, Condition, History
from tests.promises.promises import CHECKERS

from . import histories
from .histories import good, samples, silent

Moves = Sequence[tuple[float, float]]
"""When a joint has another value [s, rad]."""


def history(joint: str, moves: Moves, *overloads: Condition, has_drive: bool = True) -> History:
    """Return a history whose operator lives from 1 s to 2 s and from 30 s on."""
    joints: dict[str, Moves] = {name: [(1.0, 0.0), (40.0, 0.0)] for name in ("theta1", "theta2")}
    return histories.history(
        heartbeats=[(at, True) for at in (1.0, 2.0, 30.0, 31.0)],
        driven_time=[(1.0, (0.0, "host"))] if has_drive else [],
        faults=overloads,
        **joints | {joint: [(1.0, 0.0), *moves]},
    )


@pytest.mark.parametrize("joint", ["theta1", "theta2"])
def test_s6_joint_that_stands_in_time(joint: str) -> None:
    found = CHECKERS["S6"](history(joint, [(12.0, 0.25), (12.5, 0.5), (12.75, 0.75), (20.0, 0.75)]))

    assert found == Finding("S6", 1, "joints stood within 10.50 s, allowed 10.5 s", [], worst=10.5)


@pytest.mark.parametrize("joint", ["theta1", "theta2"])
def test_s6_joint_that_moves_too_late(joint: str) -> None:
    blind = Condition(OVERLOAD, 13.125, 14.0)  # too late to hide a sign of life
    found = CHECKERS["S6"](history(joint, [(12.0, 0.25), (13.0, 0.5), (13.25, 0.75)], blind))

    text = "a joint still moved 11.00 s after the operator's last sign of life"
    assert (found.cases, found.evidence) == (1, [Evidence(13.25, text)])


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
    moved.streams["theta1"] = samples([(0.25, 0.0), (0.5, 0.25)])

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
    assert [each.time for each in CHECKERS["S6"](long).evidence] == [13.25, 42.25]
    assert CHECKERS["S6"](long).cases == 2

    blind = [Condition(OVERLOAD, at, at + 2.5) for at in (1.5, 30.5)]
    found = CHECKERS["S6"](replace(long, conditions=blind))
    assert (found.cases, found.unknown) == (0, 2)


def test_s6_silence_as_long_as_the_limit_is_no_case() -> None:
    short = replace(history("theta1", [(12.0, 0.25), (12.25, 0.5)]), end=12.5)
    short.streams["operator_heartbeat"] = samples([(1.0, True), (2.0, True)])
    assert CHECKERS["S6"](short).cases == 0


def test_s6_without_a_drive_says_nothing() -> None:
    found = CHECKERS["S6"](history("theta1", [(20.0, 0.5), (21.0, 0.75)], has_drive=False))

    assert (found.cases, found.evidence) == (0, [])


# Jumps, while the operator lives

Report = dict[str, Any]
"""What the source of a joint reports of its movement."""
SLOW, SET, STEPS = {FASTEST: 0.5}, {BY_HAND: "value"}, {FASTEST: math.inf}


def each_second(
    report: Report, other: Report = SLOW, begin: float = 40.0, end: float = 40.0
) -> list[tuple[float, Report]]:
    """Return a report at each second, but another one from ``begin`` to ``end``."""
    return [(float(at), other if begin <= at < end else report) for at in range(40)]


ALWAYS_SLOW = each_second(SLOW)


def jumping(
    *moves: tuple[float, float], reports: Sequence[tuple[float, Report]] = ALWAYS_SLOW, alive: bool = True
) -> list[Evidence]:
    """Judge a joint that stood at 0 rad.

    :param reports: when its source reported its health, and what of the movement; by default at most
        0.5 rad/s.
    :param alive: whether the operator lives.
    """
    found = CHECKERS["S6"](
        histories.history(
            driven_time=[(1.0, (0.0, "host"))],
            heartbeats=[(at / 4.0, True) for at in range(160 if alive else 1)],
            theta1=[(1.0, 0.0), *moves],
            theta2=[(1.0, 0.0)],
            health=[(at, ("config_theta1", 7, *each.items())) for at, each in reports],
        )
    )
    return [*found.evidence]


def test_s6_joint_that_jumps_while_the_operator_lives() -> None:
    jump = Evidence(10.04, "theta1 jumped: 1.00 rad in 0.04 s, at most 0.32 is right")
    assert jumping((10.0, 0.0), (10.04, 1.0)) == [jump]


def test_s6_joint_that_jumps_between_two_drives() -> None:
    found = jumping(*((10.0 + at / 50.0, 0.1 * (at % 2)) for at in range(200)))

    assert len(found) == 4
    assert all(9.9 < each.time < 14.0 for each in found)


def test_s6_jump_between_the_late_moves_is_reported_too() -> None:
    found = jumping((20.0, 0.0), (20.04, 1.0), (20.5, 0.0), alive=False)

    assert sorted(each.text.split()[0] for each in found) == ["a", "theta1"]


IN_THE_TWENTIES = each_second(SLOW, SET, 20.0, 30.0)


def test_s6_joint_that_is_set_by_hand_may_jump() -> None:
    moves = (19.5, 0.0), (19.54, 3.0), (25.0, -3.0), (29.2, 0.0), (29.24, 0.02)
    assert jumping(*moves, reports=IN_THE_TWENTIES) == []
    assert jumping(*moves, reports=IN_THE_TWENTIES, alive=False) == []
    assert len(jumping(*moves)) == 3


def test_s6_joint_that_was_set_by_hand_may_not_move_too_late() -> None:
    (found,) = jumping((19.9, 0.0), (21.5, 3.0), reports=UNTIL_20, alive=False)
    assert found.time == 21.5


UNTIL_20, FROM_20 = each_second(SET, SLOW, 20.5), each_second(SLOW, SET, 20.0)
RESTARTED = each_second(SLOW, {FASTEST: 50.0}, 20.0)
ONE = each_second({FASTEST: 1.0})


def jump(at: float) -> Moves:
    return (at - 0.04, 0.0), (at, 3.0)


@pytest.mark.parametrize(
    ("moves", "reports", "times"),
    [
        ([(10.0 + at / 25.0, 0.02 * at) for at in range(250)], ALWAYS_SLOW, []),  # as its scenario
        ([(10.0, 0.0), (14.0, 2.0), (14.04, 2.2)], ALWAYS_SLOW, []),  # it was away, or waited
        ([(1.04, 0.0), (1.08, 0.02)], ALWAYS_SLOW, []),  # the first value of a scenario
        ([(1.5, 2.0)], [(2.0, SLOW), (3.0, SLOW)], []),
        # a path as long as the limit is no jump
        ([(10.0, 0.0), (10.5, 0.5 + AT_ONCE)], ONE, []),
        ([(10.0, 0.0), (10.5, 0.501 + AT_ONCE)], ONE, [10.5]),
        # jumps are reported once in a second
        (
            [(10.0, 0.0), (10.25, 0.05), (10.5, 2.0), (10.75, 0.0), (11.5, 2.0), (20.0, 2.0)],
            ALWAYS_SLOW,
            [10.5, 11.5],
        ),
        (jump(10.04), each_second(STEPS), []),
        # another scenario may be faster
        (jump(20.54), RESTARTED, []),
        (jump(15.54), RESTARTED, [15.54]),
        # before and after a hand
        ([*jump(10.04), (35.0, 3.0), (35.04, 0.0)], IN_THE_TWENTIES, [10.04, 35.04]),
        (jump(20.5), UNTIL_20, []),
        (jump(21.5), UNTIL_20, [21.5]),
        (jump(19.5), FROM_20, []),
        (jump(18.5), FROM_20, [18.5]),
        (jump(1.5), [(1.0, SET), (2.0, SLOW)], []),
        (jump(1.5), [(1.0, SLOW), (2.0, SLOW)], [1.5]),
        # without a report before or after, it may be set by hand
        (jump(1.5), [(1.0, SLOW)], []),
        (jump(1.5), [(2.0, SLOW)], []),
        ([], [(2.0, SLOW)], []),
    ],
)
def test_s6_joint_jumps_if_it_goes_further_than_the_reports_around_it_say(
    moves: Moves, reports: Sequence[tuple[float, Report]], times: list[float]
) -> None:
    assert [each.time for each in jumping(*moves, reports=reports)] == times


def test_s6_joints_of_a_good_history_move_only_with_an_operator() -> None:
    assert CHECKERS["S6"](good()).evidence == []
    assert CHECKERS["S6"](silent(good(), topics.OPERATOR_HEARTBEAT.name, 20.0, 40.0)).verdict != HOLDS
