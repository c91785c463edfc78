"""The findings in full, cases, figures and evidence, on small histories at exact moments."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from interfaces.robot_model import forward_kinematics
from interfaces.topics import ALIVE, DRIVE_TIMEOUT, INCAPACITATED, MISSED, OFF, ON, TURN_OFF, TURN_ON
from tests.promises.effects import TRANSPORT
from tests.promises.findings import Evidence, Finding
from tests.promises.history import (
    ALL,
    BAD_LINE,
    CONTROLLER,
    HOLD,
    HOST,
    KINEMATICS,
    LOSE,
    NO_TARGET,
    OPERATOR,
    RIVAL,
    STUCK_DRIVE,
    SWITCH,
    WATCHDOG,
    Condition,
    InjectedFault,
    Life,
)
from tests.promises.marks import STEP
from tests.promises.promises import CHECKERS

from . import histories

history = partial(histories.history, delay=0.125)


def steps(begin: float, end: float, step: float = 0.25, value: Any = True) -> list[tuple[float, Any]]:
    """Return a message at each step, the first and the last included."""
    return [(begin + n * step, value) for n in range(round((end - begin) / step) + 1)]


def engines(*switched: tuple[float, str]) -> list[tuple[float, str]]:
    """Return the states of engines that are switched at these times, repeated every 0.25 s."""
    ends = [*(at for at, _ in switched[1:]), 40.25]
    return [
        each
        for (begin, state), end in zip(switched, ends, strict=True)
        for each in steps(begin, end - 0.25, value=state)
    ]


def overload(begin: float, end: float) -> Condition:
    return Condition("overload", begin, end)


# S1

KEPT_ON = "operator_watchdog sent no turn_off, engine_controller still sent on"
KEPT_BY_THE_DRIVE = "operator_watchdog sent no turn_off, the drive kept the last command"
STOPPED = [InjectedFault("stop", each, 0.0, 40.0) for each in ("operator_watchdog", "engine_controller")]
"""Faults after which only the drive stops the engines."""


def test_s1_counts_silences_that_last_until_the_engines_are_off() -> None:
    heartbeats = [*steps(1, 2), *steps(4, 5), *steps(6, 8), *steps(10, 12), (30.0, True), (31.0, True)]
    states = engines(
        (1.0, ON),
        (5.5, OFF),  # in a silence of one second
        (6.0, ON),
        (9.0, OFF),  # in a silence of two seconds
        (10.0, ON),
        (22.5, OFF),  # 10.5 s after the last heartbeat
    )
    assert CHECKERS["S1"](history(heartbeats=heartbeats, states=states, faults=STOPPED)) == Finding(
        "S1", 2, "off within 10.50 s, allowed 10.5 s", [], worst=10.5
    )


def test_s1_operator_who_is_never_silent_is_no_case() -> None:
    found = CHECKERS["S1"](history(heartbeats=steps(0, 40), states=engines((0.0, ON)), faults=STOPPED))
    assert found == Finding("S1", 0, "off within 0.25 s, allowed 10.5 s", [], worst=0.25)


def test_s1_tells_the_longest_time_with_and_without_faults() -> None:
    heartbeats = [*steps(1, 2), *steps(15, 16), (36.0, True)]
    states = engines((1.0, ON), (12.0, OFF), (15.0, ON), (25.5, OFF))
    assert CHECKERS["S1"](history(heartbeats=heartbeats, states=states)) == Finding(
        "S1", 2, "off within 10.00 s, allowed 10.5 s; undisturbed 10.00 s, allowed 10.05 s", [], worst=10.0
    )


def test_s1_evidence_has_the_moment_of_the_violation() -> None:
    states = engines((1.0, ON), (1.5, OFF), (5.0, ON), (17.0, OFF))
    late = [(16.0, TURN_OFF)]
    judged = history(heartbeats=[(5.0, True)], states=states, commands=late, faults=STOPPED)
    assert CHECKERS["S1"](judged) == Finding(
        "S1",
        1,
        "off within 12.00 s, allowed 10.5 s",
        [
            Evidence(1.0, "engines on before the operator's first sign of life"),
            Evidence(
                15.5,
                "engines still on 10.5 s after the operator's last sign of life, for 12.00 s in all",
                KEPT_ON,
            ),
        ],
        worst=12.0,
    )


def test_s1_controller_that_sent_an_on_just_before_kept_the_engines_on() -> None:
    states = steps(2, 12.25, value=ON)  # the drive keeps the last one for 0.4 s
    (evidence,) = CHECKERS["S1"](history(heartbeats=[(2.0, True)], states=states, faults=STOPPED)).evidence
    assert (evidence.time, evidence.cause) == (12.5, KEPT_ON)


def test_s1_short_silence_is_a_case_after_a_long_one() -> None:
    states = engines((1.0, ON), (11.0, OFF), (20.0, ON), (23.0, OFF))
    heartbeats = [*steps(1, 2), *steps(19, 21), *steps(26, 27)]
    assert CHECKERS["S1"](history(heartbeats=heartbeats, states=states)).cases == 2


@pytest.mark.parametrize(
    ("fault", "off", "found"),
    [
        (InjectedFault("kill", WATCHDOG, 11.0, 11.0), 12.25, 0),
        (InjectedFault("kill", WATCHDOG, 13.0, 13.0), 12.25, 1),  # the engines were off
        (InjectedFault(STEP, NO_TARGET, 5.0, 5.0), 12.25, 0),
        (InjectedFault(LOSE, "engines", 5.0, 13.0), 12.25, 0),
        (InjectedFault(LOSE, "engines", 5.0, 13.0), 12.5, 1),  # F2 needs no command
        (InjectedFault(HOLD, "operator_presence", 5.0, 13.0), 12.25, 1),
    ],
)
def test_s1_fault_of_one_fail_safe_allows_what_the_next_one_needs(
    fault: InjectedFault, off: float, found: int
) -> None:
    judged = history(heartbeats=[(2.0, True)], states=engines((2.0, ON), (off, OFF)), faults=[fault])
    assert len(CHECKERS["S1"](judged).evidence) == found


@pytest.mark.parametrize(
    ("overloads", "off", "lasted"),
    [
        ([], 12.5, 10.5),
        ([], 12.75, 10.75),
        ([overload(2.0, 2.5)], 13.0, 10.5),  # in it, the last sign of life may have been missed
        ([overload(2.0, 2.5)], 13.25, 10.75),
        ([overload(2.25, 2.5)], 13.25, 10.75),
        ([overload(6.0, 6.5), overload(6.25, 7.0)], 17.0, 10.0),
        ([overload(6.0, 7.0)], 17.75, 10.75),
        ([overload(12.0, 12.25)], 12.75, 10.0),
        ([overload(12.5, 12.75)], 12.75, 10.5),
        ([overload(2.0, 13.0)], 12.0, 0.0),
        ([overload(2.0, 15.0)], 14.0, 0.0),
        ([overload(12.625, 13.0)], 12.75, 10.625),
    ],
)
def test_s1_silence_begins_after_an_overload_at_the_latest(
    overloads: list[Condition], off: float, lasted: float
) -> None:
    found = CHECKERS["S1"](
        history(
            heartbeats=[(2.0, True)], states=engines((2.0, ON), (off, OFF)), faults=[*overloads, *STOPPED]
        )
    )
    is_late, is_known = lasted > 10.5, lasted > 10.5 or off <= 12.5
    assert [each.text for each in found.evidence] == (
        [f"engines still on 10.5 s after the operator's last sign of life, for {lasted:.2f} s in all"]
        if is_late
        else []
    )
    assert all(each.time == off - lasted + 10.5 for each in found.evidence if not overloads)
    assert (found.cases, found.unknown) == ((1, 0) if is_known else (0, 1))
    assert found.worst == (lasted if is_known else 0.0)


def test_s1_counts_each_silence_that_an_overload_leaves_unknown() -> None:
    states = engines((2.0, ON), (13.0, OFF), (20.0, ON), (31.0, OFF))
    faults = [overload(2.0, 2.5), overload(20.0, 20.5), *STOPPED]
    found = CHECKERS["S1"](history(heartbeats=[(2.0, True), (20.0, True)], states=states, faults=faults))
    assert (found.cases, found.unknown, found.evidence) == (0, 2, [])


def test_s1_first_sign_of_life_may_have_been_missed_in_an_overload() -> None:
    states = engines((3.0, ON), (13.25, OFF))
    found = [
        CHECKERS["S1"](history(heartbeats=[(30.0, True)], states=states, faults=[each]))
        for each in (overload(2.0, 2.75), overload(2.0, 2.5), overload(3.5, 4.0), overload(2.0, 14.0))
    ]
    assert [(each.cases, each.unknown) for each in found] == [(0, 1), (1, 0), (0, 0), (0, 1)]
    assert found[1].evidence == [
        Evidence(
            13.0,
            "engines still on 10.5 s after the operator's last sign of life, for 10.75 s in all",
            KEPT_ON,
        )
    ]
    assert found[2].evidence == [Evidence(3.0, "engines on before the operator's first sign of life")]


@pytest.mark.parametrize(
    ("begin", "end", "lasted"),
    [
        (2.0, 20.0, 12.0),  # until the next state
        (2.0, 11.5, 9.5),  # until the drive works again
        (6.0 + DRIVE_TIMEOUT, 20.0, 12.0),
        (6.5, 20.0, 4.375),  # too late: it has stopped
        (2.0, 6.375, 4.375),
    ],
)
def test_s1_stuck_drive_keeps_the_engines_on(begin: float, end: float, lasted: float) -> None:
    states = [*steps(2, 6, value=ON), (14.0, OFF)]
    stuck = InjectedFault(STUCK_DRIVE, NO_TARGET, begin, end)
    found = CHECKERS["S1"](history(heartbeats=[(2.0, True)], states=states, faults=[stuck]))
    assert found.worst == pytest.approx(min(lasted, end - 2.0) if lasted > 9.0 else 4.0 + DRIVE_TIMEOUT)
    assert [each.cause for each in found.evidence] == [KEPT_BY_THE_DRIVE] * (lasted > 10.5)


# S2

PRESENT = {"heartbeats": steps(0, 40), "presences": steps(0, 40, 0.5)}


def test_s2_overload_just_before_makes_the_outcome_unknown() -> None:
    states = engines((0.0, ON), (10.0, OFF), (11.0, ON), (20.0, OFF), (21.0, ON), (30.0, OFF))
    faults = [overload(9.5, 9.625), overload(19.5, 19.625), overload(28.5, 28.625)]
    assert CHECKERS["S2"](history(**PRESENT, states=states, faults=faults)) == Finding(
        "S2",
        0,
        "0 kills while on; turned off 0 times for a permitted reason",
        [Evidence(30.0, "engines turned off although the operator was present")],
        2,
    )


@pytest.mark.parametrize(
    ("stop", "resume", "off", "is_blamed"),
    [
        (10.25, 14.0, 14.0, False),  # its `on` was ready when it was suspended
        (10.25, 13.996, 14.004, False),
        (10.25, 13.97, 14.0, True),  # it had time to see how long it had stood still
        (10.25, 15.0, 14.0, True),  # it runs although it is suspended
        (10.25, 14.0, 14.03, True),  # the engines start
    ],
)
def test_s2_and_s3_allow_an_on_that_a_suspension_interrupts(
    stop: float, resume: float, off: float, is_blamed: bool
) -> None:
    states = [*steps(0, 10.25, value=ON), (14.0, ON), *steps(off, 40, value=OFF)]
    stop_of_controller = stopped(CONTROLLER, stop, resume)
    arm = history(**PRESENT, states=states, commands=[(0.0, TURN_ON)], faults=[stop_of_controller])
    assert [each.time for each in CHECKERS["S2"](arm).evidence] == [off] * is_blamed
    assert [each.time for each in CHECKERS["S3"](arm).evidence] == [14.0] * is_blamed


@pytest.mark.parametrize(("stop", "is_blamed"), [(9.5, True), (9.625, False), (9.875, False)])
def test_s3_allows_an_on_that_a_suspension_too_short_to_notice_delays(stop: float, is_blamed: bool) -> None:
    states = [*steps(0, 9.5, 0.125, ON), *steps(10.0, 40, 0.125, ON)]
    arm = history(
        **PRESENT, states=states, commands=[(0.0, TURN_ON)], faults=[stopped(CONTROLLER, stop, 10.0)]
    )
    assert [each.time for each in CHECKERS["S3"](arm).evidence] == [10.0] * is_blamed


def test_s2_counts_kills_while_engines_are_on_and_the_operator_is_present() -> None:
    lives = [
        Life(CONTROLLER, 1, 0.0, 9.875),
        Life(CONTROLLER, 2, 9.875, 20.0),
        Life(CONTROLLER, 3, 20.0, None),
    ]
    faults = [
        InjectedFault("kill", "velocity", 0.5, 0.5),  # before the first state
        InjectedFault("kill", "velocity", 5.0, 5.0),  # a case
        InjectedFault("terminate", "velocity", 6.0, 6.0),
        InjectedFault("kill", CONTROLLER, 9.875, 9.875, 1),
        InjectedFault("kill", "velocity", 10.875, 10.875),  # while off
        InjectedFault("kill", "velocity", 11.125, 11.125),  # a case
        InjectedFault("kill", "velocity", 34.0, 34.0),  # a case: the last heartbeat is one second old
        InjectedFault("kill", "velocity", 35.0, 35.0),
    ]
    states = engines((1.0, ON), (10.0, OFF), (11.0, ON), (20.0, OFF), (21.0, ON))
    found = CHECKERS["S2"](
        history(
            heartbeats=steps(0, 33), presences=steps(0, 33, 0.5), states=states, lives=lives, faults=faults
        )
    )
    assert found == Finding("S2", 3, "3 kills while on; turned off 2 times for a permitted reason", [])


def two_lives(program: str, began: float) -> list[Life]:
    return [Life(program, 1, 0.0, began - 0.01), Life(program, 2, began, None)]


def stopped(program: str, begin: float, end: float, kind: str = "stop") -> InjectedFault:
    return InjectedFault(kind, program, begin, end)


def bad_line(begin: float, end: float) -> InjectedFault:
    return InjectedFault(BAD_LINE, ALL, begin, end)


def heard_but_in(*silences: tuple[float, float]) -> list[tuple[float, bool]]:
    return [beat for beat in steps(0.25, 40) if not any(begin < beat[0] < end for begin, end in silences)]


SILENCES = ((4.0, 7.0), (8.0, 11.0), (12.0, 15.0))  # a strike each
AFTER_A_PAUSE = [(at, state) for at, state in engines((0.0, ON), (20.0, OFF)) if not 19.0 < at < 20.0]
UNSEEN = {"presences": steps(0, 10), "heartbeats": steps(0, 40)}
FIRST_UNSEEN = 20.0 - 10.0 + 0.1 + TRANSPORT
SHORT = heard_but_in(*SILENCES[:2], (12.0, 14.25))  # the last silence lacks 0.75 s of a strike
SHORTER = heard_but_in(*SILENCES[:2], (12.0, 13.75))
OFF_AT_14_5 = engines((0.0, ON), (14.5, OFF))  # the third strike is counted at this time
COMMANDED = {"commands": [(20.0, TURN_OFF)], "heartbeats": heard_but_in(*SILENCES)}


def suspended_with_a_presence_at(time: float) -> dict[str, Any]:
    presences = [*UNSEEN["presences"], (time, time)]
    return UNSEEN | {"presences": presences, "faults": [stopped(WATCHDOG, 15.0, 16.0)]}


@pytest.mark.parametrize(
    ("parts", "permitted"),
    [
        # the controller was away
        ({"lives": two_lives(CONTROLLER, 20.0)}, True),
        ({"lives": two_lives(CONTROLLER, 19.75)}, True),
        ({"lives": two_lives(CONTROLLER, 19.75 - 0.02)}, False),
        ({"states": AFTER_A_PAUSE, "faults": [stopped(CONTROLLER, 19.25, 19.75)]}, True),
        ({"states": AFTER_A_PAUSE, "faults": [stopped("velocity", 19.25, 19.75)]}, False),
        ({"states": AFTER_A_PAUSE, "faults": [stopped(CONTROLLER, 5.0, 6.0)]}, False),
        ({"faults": [stopped(CONTROLLER, 19.75, 20.0)]}, False),
        ({"states": [(0.0, ON), (DRIVE_TIMEOUT, OFF)], "faults": [stopped(CONTROLLER, 0.125, 0.25)]}, False),
        # a rival opposed it, and may not have gone until ten seconds later
        ({"faults": [stopped(NO_TARGET, 5.0, 9.875, RIVAL)]}, True),
        ({"faults": [stopped(NO_TARGET, 5.0, 9.75, RIVAL)]}, False),
        # the watchdog commanded it
        (COMMANDED, True),
        (COMMANDED | {"commands": [(20.5, TURN_OFF)]}, False),
        (COMMANDED | {"commands": [(18.0, TURN_ON), (20.0, TURN_OFF)]}, True),
        (COMMANDED | {"commands": [(19.0, TURN_OFF), (20.0, TURN_OFF)]}, True),
        (COMMANDED | {"commands": [(18.5, TURN_OFF), (20.0, TURN_OFF)]}, False),
        (COMMANDED | {"commands": [(14.375, TURN_OFF), (14.5, TURN_OFF)], "states": OFF_AT_14_5}, True),
        (COMMANDED | {"commands": [(14.375, TURN_OFF)], "states": OFF_AT_14_5}, False),
        (COMMANDED | {"lives": two_lives(WATCHDOG, 10.0)}, False),
        (COMMANDED | {"lives": two_lives(WATCHDOG, 20.0)}, True),
        (
            {
                "commands": [(11.0, TURN_OFF), (20.0, TURN_OFF)],  # at a heartbeat
                "heartbeats": heard_but_in((8.0, 11.0), (12.0, 15.0), (15.0, 18.0)),
            },
            False,
        ),
        # another publisher commanded it: the watchdog has not concluded that the operator is away
        ({"commands": [(20.0, TURN_OFF)], "conclusions": [(1.0, ALIVE), (19.0, MISSED)]}, True),
        ({"commands": [(20.0, TURN_ON)], "conclusions": [(1.0, ALIVE)]}, False),
        ({"commands": [(20.5, TURN_OFF)], "conclusions": [(1.0, ALIVE)]}, False),
        ({"commands": [(20.0, TURN_OFF)], "conclusions": [(20.0, INCAPACITATED)]}, False),
        ({"commands": [(20.0, TURN_OFF)], "conclusions": [(20.25, INCAPACITATED)]}, False),
        (
            {
                "commands": [(19.875, TURN_OFF), (20.0, TURN_OFF)],
                "conclusions": [(1.0, ALIVE), (20.0, INCAPACITATED)],
            },
            True,
        ),
        (
            COMMANDED
            | {
                "commands": [(18.5, TURN_OFF), (20.0, TURN_OFF)],  # the first one ends no strikes
                "conclusions": [(1.0, ALIVE), (20.0, INCAPACITATED)],
            },
            True,
        ),
        # a bad line delays the command
        (COMMANDED | {"commands": [(19.75, TURN_OFF)]}, False),
        (COMMANDED | {"commands": [(19.75, TURN_OFF)], "faults": [bad_line(19.0, 19.5)]}, True),
        (COMMANDED | {"commands": [(19.5, TURN_OFF)], "faults": [bad_line(19.75, 25.0)]}, True),
        (
            COMMANDED
            | {
                "commands": [(19.75, TURN_OFF)],
                "faults": [bad_line(19.0, 19.5)],
                "lives": two_lives(WATCHDOG, 19.875),  # the successor counts no strikes of the first one
            },
            True,
        ),
        (COMMANDED | {"commands": [(19.75, TURN_OFF)], "faults": [bad_line(19.0, 19.375)]}, False),
        (COMMANDED | {"commands": [(19.75, TURN_OFF)], "faults": [bad_line(20.25, 25.0)]}, False),
        (COMMANDED | {"commands": [(19.375, TURN_OFF)], "faults": [bad_line(19.0, 25.0)]}, False),
        # a suspended watchdog hears nothing
        (COMMANDED | {"faults": [stopped(WATCHDOG, 13.0, 14.0)]}, True),
        (COMMANDED | {"faults": [stopped(WATCHDOG, 25.0, 26.0)]}, True),
        (
            COMMANDED | {"heartbeats": heard_but_in(*SILENCES[:2]), "faults": [stopped(WATCHDOG, 0.0, 2.5)]},
            True,
        ),
        (
            COMMANDED
            | {"heartbeats": heard_but_in(*SILENCES[1:]), "faults": [stopped(WATCHDOG, 13.0, 15.5)]},
            False,
        ),
        (
            COMMANDED
            | {"heartbeats": heard_but_in(*SILENCES[1:]), "faults": [stopped(WATCHDOG, 13.0, 18.0)]},
            True,
        ),
        # when it was cut off later than three silences ago, it had too few strikes
        (
            COMMANDED
            | {"heartbeats": steps(0.25, 40), "faults": [stopped(NO_TARGET, 14.0, 30.0, "partition")]},
            False,
        ),
        # while a step of the time of day spreads, heartbeats have a wrong age
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 14.0, 14.0, STEP)]}, True),
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 13.25, 13.25, STEP)]}, False),
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 14.5, 14.5, STEP)]}, False),
        # and so has the heartbeat of 14.25 s, if it is read after the step
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 14.3125, 14.3125, STEP)]}, True),
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 14.375, 14.375, STEP)]}, False),
        # late heartbeats are no sign of life
        (
            COMMANDED | {"heartbeats": SHORT, "faults": [stopped("operator_heartbeat", 14.0, 15.0, HOLD)]},
            True,
        ),
        (
            COMMANDED | {"heartbeats": SHORT, "faults": [stopped("operator_heartbeat", 14.5, 15.0, HOLD)]},
            False,
        ),
        (
            COMMANDED | {"heartbeats": SHORT, "faults": [stopped("operator_presence", 14.0, 15.0, HOLD)]},
            False,
        ),
        # what a bad line or a new switch sends, the watchdog may miss
        (COMMANDED | {"heartbeats": SHORT, "faults": [bad_line(14.0, 15.0)]}, True),
        (COMMANDED | {"heartbeats": SHORT, "faults": [bad_line(14.5, 15.5)]}, False),
        (COMMANDED | {"heartbeats": SHORT, "lives": two_lives(SWITCH, 13.0)}, True),
        (COMMANDED | {"heartbeats": SHORT, "lives": two_lives(SWITCH, 12.25)}, False),
        # a flood delays heartbeats by 0.6 s at most
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 14.0, 16.0, "flood")]}, True),
        (COMMANDED | {"heartbeats": SHORT, "faults": [stopped(NO_TARGET, 14.75, 16.0, "babble")]}, False),
        (COMMANDED | {"heartbeats": SHORTER, "faults": [stopped(NO_TARGET, 13.0, 16.0, "flood")]}, False),
        # no presence for ten seconds, for a reason
        (UNSEEN, False),
        (UNSEEN | {"heartbeats": steps(0, 40, 1.0)}, False),
        (UNSEEN | {"heartbeats": heard_but_in((15.0, 16.25))}, True),
        (UNSEEN | {"heartbeats": heard_but_in((15.0, 16.25)), "presences": [(20.0, 20.0)]}, True),
        (UNSEEN | {"faults": [stopped(WATCHDOG, 15.0, 16.0)]}, True),
        (UNSEEN | {"faults": [stopped(ALL, 15.0, 16.0, "hang")]}, True),
        (suspended_with_a_presence_at(15.0), False),
        (suspended_with_a_presence_at(15.5), True),  # of a heartbeat before
        (suspended_with_a_presence_at(16.0 + TRANSPORT), True),
        (suspended_with_a_presence_at(16.5), False),
        (UNSEEN | {"faults": [stopped(WATCHDOG, 15.0, 16.0, "crash_loop")]}, False),
        (UNSEEN | {"faults": [stopped("velocity", 15.0, 16.0)]}, False),
        (UNSEEN | {"faults": [stopped(WATCHDOG, 20.0, 21.0)]}, False),
        (UNSEEN | {"faults": [stopped(WATCHDOG, 9.0, FIRST_UNSEEN)]}, False),
        (UNSEEN | {"faults": [stopped(NO_TARGET, 1.0, 2.0, "partition")]}, True),
        (UNSEEN | {"faults": [stopped(NO_TARGET, 0.0, 0.25, "partition")]}, False),
        # the last presence is of a heartbeat before a silence, although the operator has returned
        (UNSEEN | {"presences": [(15.0, 15.0)], "heartbeats": heard_but_in((10.0, 15.25))}, True),
        (UNSEEN | {"presences": [(15.0, 15.0)], "heartbeats": heard_but_in((10.5, 15.25))}, False),
        (UNSEEN | {"presences": [(15.25, 15.25)], "heartbeats": heard_but_in((10.0, 15.25))}, False),
    ],
)
def test_s2_reasons_that_permit_to_turn_off(parts: dict[str, Any], permitted: bool) -> None:
    found = CHECKERS["S2"](history(**PRESENT | {"states": engines((0.0, ON), (20.0, OFF))} | parts))
    assert (len(found.evidence), found.unknown) == (not permitted, 0)
    assert f"turned off {'once' if permitted else '0 times'} for" in found.measured


# S3


def test_s3_each_start_needs_a_command_and_a_sign_of_life_of_its_own() -> None:
    states = engines(
        (0.0, OFF),
        (5.0, ON),
        (6.0, OFF),
        (10.0, ON),  # command and sign of life at the same moment
        (10.5, OFF),
        (10.75, ON),  # with another command
        (11.0, OFF),
        (20.0, ON),  # the command comes later
        (20.5, OFF),
        (25.0, ON),
        (25.25, OFF),
        (25.5, ON),  # by the same command, which came at the last moment
        (26.0, OFF),
        (35.0, ON),  # without a sign of life
    )
    commands = [(at, TURN_ON) for at in (4.75, 10.0, 10.75, 20.5, 25.01, 34.5)]
    heartbeats = [(4.5, True), (10.0, True), (10.75, True), *steps(20, 30)]
    assert CHECKERS["S3"](history(states=states, commands=commands, heartbeats=heartbeats)) == Finding(
        "S3",
        4,
        "turned on 4 times, operator seen at most 0.50 s before",
        [
            Evidence(20.0, "engines turned on without a turn_on in the last 1 s"),
            Evidence(25.5, "engines turned on without a turn_on in the last 1 s"),
            Evidence(35.0, "engines turned on without a sign of life in the last 1 s"),
        ],
    )


def test_s3_new_switch_or_overload_makes_the_outcome_unknown() -> None:
    lives = [Life(SWITCH, 1, 0.0, 10.0), Life(SWITCH, 2, 10.0, 17.0), Life(SWITCH, 3, 17.0, None)]
    starts = (
        10.0,  # at the start of a switch
        11.0,  # within three seconds
        20.0,  # three seconds after
        25.0,
        30.0,  # after an overload
    )
    switched = [(0.0, OFF)]
    for at in starts:
        switched += [(at, ON), (at + 0.5, OFF)]
    faults = [overload(24.5, 24.625), overload(29.5, 29.625)]
    found = CHECKERS["S3"](history(**PRESENT, states=engines(*switched), lives=lives, faults=faults))
    assert [each.time for each in found.evidence] == [20.0]
    assert (found.cases, found.unknown) == (0, 4)


@pytest.mark.parametrize(
    ("stop", "event", "unknown"),
    [
        (19.75, stopped(NO_TARGET, 5.0, 9.875, RIVAL), 1),
        (19.75, stopped(NO_TARGET, 5.0, 9.5, RIVAL), 0),  # it had gone before the engines stopped
        (10.0, stopped(NO_TARGET, 5.0, 8.75, RIVAL), 0),  # and long before they started
        (19.75, overload(19.5, 19.875), 1),
        (19.75, overload(19.25, 19.5), 0),
        (10.0, overload(15.0, 15.5), 0),
    ],
)
def test_s3_event_before_the_stop_or_long_before_the_start_excuses_nothing(
    stop: float, event: InjectedFault | Condition, unknown: int
) -> None:
    states = engines((0.0, ON), (stop, OFF), (20.0, ON))
    found = CHECKERS["S3"](history(**PRESENT, states=states, commands=[(0.0, TURN_ON)], faults=[event]))
    assert [each.time for each in found.evidence] == [20.0] * (1 - unknown)
    assert found.unknown == unknown


def test_s3_start_without_a_sign_of_life_uses_its_command_up() -> None:
    states = engines((0.0, OFF), (20.0, ON), (20.25, OFF), (20.5, ON))
    found = CHECKERS["S3"](history(states=states, commands=[(20.0, TURN_ON)], heartbeats=[(20.25, True)]))
    assert [each.time for each in found.evidence] == [20.0, 20.5]


@pytest.mark.parametrize(("presence", "unknown"), [(19.0, 1), (20.0, 1), (20.5, 0), (18.0, 0)])
def test_s3_a_new_switch_excuses_only_a_present_operator(presence: float, unknown: int) -> None:
    states = engines((0.0, OFF), (20.0, ON), (20.25, OFF))
    found = CHECKERS["S3"](
        history(states=states, presences=[(presence, presence)], lives=two_lives(SWITCH, 19.0))
    )
    assert (len(found.evidence), found.unknown) == (1 - unknown, unknown)


# S4

LINKS = {name: [(0.0, value)] for name, value in {"l1": 1.0, "l2": 1.0, "theta1": 0.0, "theta2": 0.0}.items()}


def test_s4_names_wrong_speeds_and_positions() -> None:
    right, wrong = (2.0, 0.0), (5.0, 0.0)
    positions = [(5.0, right), (6.0, wrong), (10.0, wrong), (10.5, wrong)]
    speeds = [(5.0, 0.0), (6.0, -0.5), (7.0, 0.5)]
    found = CHECKERS["S4"](history(**LINKS, positions=positions, speeds=speeds, faults=[overload(9.5, 10.0)]))
    assert found == Finding(
        "S4",
        5,
        "4 positions, 3 speeds",
        [Evidence(6.0, "speed -0.5"), Evidence(6.0, "no published values give (5.0, 0.0)")],
        2,
    )


@pytest.mark.parametrize(
    ("theta2", "right", "mirrored"),
    [(0.0, (2.0, 0.0), (0.0, 0.0)), (math.pi / 2.0, (1.0, 1.0), (1.0, -1.0))],
)
def test_s4_mirrored_position_is_wrong(
    theta2: float, right: tuple[float, float], mirrored: tuple[float, float]
) -> None:
    links = LINKS | {"theta2": [(0.0, theta2)]}
    found = CHECKERS["S4"](history(**links, positions=[(5.0, right), (6.0, mirrored)]))
    assert [each.time for each in found.evidence] == [6.0]


@pytest.mark.parametrize(("l1", "l2"), [(1.0, 1e9), (1e9, 1.0)])
def test_s4_position_is_rounded_as_its_longer_link(l1: float, l2: float) -> None:
    values = [(l1, l2, 0.3 + step, 0.4 + 2.7 * step) for step in range(20)]
    streams = ([(1.0 + n, each) for n, each in enumerate(joint)] for joint in zip(*values, strict=True))
    links = dict(zip(LINKS, streams, strict=True))
    positions = [(1.5 + n, forward_kinematics(*each)) for n, each in enumerate(values)]
    found = CHECKERS["S4"](history(**links, positions=positions))
    assert (found.cases, found.evidence) == (20, [])


# S5


def test_s5_names_each_pair_of_supervisords_in_the_order_of_their_start() -> None:
    lives = [
        Life("", 5, 10.0, 20.0),
        Life("", 2, 5.0, 9.5),
        Life("", 1, 0.0, None),
        Life("", 3, 21.0, 25.0),  # refuses within four seconds
        Life(KINEMATICS, 7, 0.0, 8.0),
        Life(KINEMATICS, 8, 4.0, None),  # neither reports
    ]
    assert CHECKERS["S5"](history(lives=lives)) == Finding(
        "S5",
        4,
        "restarts and duplicates: 4",
        [
            Evidence(5.0, "processes 1 and 2 are both supervisord"),
            Evidence(10.0, "processes 1 and 5 are both supervisord"),
        ],
    )


def test_s5_reports_of_a_second_process() -> None:
    ends = {7: 3.0, 8: 6.0, 9: 9.0, 10: 10.0}
    lives = [Life("velocity", pid, 0.0, end) for pid, end in ends.items()]
    reports = [(1.0, 7), (3.0, 8), (5.0, 9), (8.0, 10), (8.5, 9), (9.25, 11)]
    health = [(at, ("velocity", pid)) for at, pid in reports]
    lives.append(Life(KINEMATICS, 20, 0.0, None))
    health += [(1.0, (KINEMATICS, 20)), (12.0, (KINEMATICS, 7))]  # a pid that velocity had before
    faults = [overload(5.5, 5.625), overload(9.5, 9.625), overload(15.0, 15.5)]
    found = CHECKERS["S5"](history(health=health, lives=lives, faults=faults))
    together = [each for each in found.evidence if " while " in each.text]
    assert together == [
        Evidence(8.0, "process 10 runs velocity while process 9 lives"),
        Evidence(12.0, "process 7 runs kinematics while process 20 lives"),
    ]
    assert found.unknown == 2


def test_s5_names_each_process_beside_a_third_one() -> None:
    lives = [Life("velocity", pid, 0.0, None) for pid in (7, 8, 9)]
    found = CHECKERS["S5"](history(health=[(pid, ("velocity", pid)) for pid in (7, 8, 9)], lives=lives))
    beside = "process 9 runs velocity while process"
    assert [each.text for each in found.evidence[1:]] == [f"{beside} 7 lives", f"{beside} 8 lives"]


def test_s5_evidence_is_in_the_order_of_time() -> None:
    supervisors = [Life("", pid, begin, None) for pid, begin in ((1, 0.0), (2, 5.0))]
    lives = [*supervisors, *(Life("velocity", pid, 0.0, None) for pid in (7, 8))]
    health = [(at, ("velocity", pid)) for at, pid in ((1.0, 7), (8.0, 8))]
    found = CHECKERS["S5"](history(health=health, lives=lives))
    assert [each.time for each in found.evidence] == [5.0, 8.0]


def test_s5_services_of_two_hosts_may_have_one_name() -> None:
    hosts = {7: "robot", 8: "operator"}
    health = [(1.0 + pid, ("velocity", pid, (HOST, host))) for pid, host in hosts.items()]
    lives = [Life("velocity", pid, 0.0, None) for pid in hosts]
    assert not CHECKERS["S5"](history(health=health, lives=lives)).evidence


# L1


def kill(program: str, *times: float) -> list[InjectedFault]:
    return [InjectedFault("kill", program, at, at) for at in times]


def back(*silences: tuple[float, float], period: float = 0.25) -> list[tuple[float, float]]:
    """Return messages with these silences: when each begins, and for how long the observer hears nothing."""
    every = (at for at, _ in steps(0, 40, period))
    heard = [at for at in every if not any(0 < at - begin < length for begin, length in silences)]
    return [(at, 0.0) for at in sorted({*heard, *(begin + length - 0.125 for begin, length in silences)})]


def test_l1_counts_silences_and_those_that_nobody_can_know() -> None:
    found = CHECKERS["L1"](
        history(
            l1=back((2.0, 0.875), (8.0, 1.0), (14.0, 1.5), (20.0, 2.0)),
            l2=[message for message in back((26.0, 3.0)) if message[0] > 4.0],
            theta1=[message for message in back((26.0, 2.5)) if message[0] > 4.0],
            theta2=back((10.0, 3.0), (20.0, 0.5)),
            faults=[
                *kill("config_l1", 2.0, 8.0, 14.0, 20.0),
                *kill("config_l2", 3.0, 26.0),  # without output before, and in a pause of the machine
                *kill("config_theta1", 3.0, 26.0),
                *kill("config_theta2", 10.0, 20.0),
                overload(26.5, 27.5),
            ],
        )
    )
    assert found == Finding(
        "L1",
        6,
        "p50 1.00 s, p99 3.00 s",
        [
            Evidence(
                10.0, "config_theta2 is silent for 3.00 s after SIGKILL", "supervisord did not start it again"
            )
        ],
        4,
        {"config_l1": [0.875, 1.0, 1.5, 2.0], "config_theta2": [3.0, 0.5]},
        3.0,
    )


def test_l1_slow_median_is_told_with_its_longest_silence() -> None:
    silences = ((5.0, 1.5), (15.0, 1.75), (25.0, 0.5))
    output = back(*silences)
    found = CHECKERS["L1"](history(l1=output, faults=kill("config_l1", *(at for at, _ in silences))))
    median = "config_l1: the median silence after its 3 kills is 1.50 s"
    assert found.evidence == [Evidence(15.0, median, "after this kill, it was silent for 1.75 s")]


def test_l1_two_kills_have_no_median() -> None:
    found = CHECKERS["L1"](history(l1=back((5.0, 1.5), (15.0, 1.75)), faults=kill("config_l1", 5.0, 15.0)))
    assert (found.cases, found.evidence) == (2, [])


def test_l1_silence_is_told_with_the_start_of_the_next_process() -> None:
    times = [(0.0, 10.0), (10.5, 11.0), (11.5, None)]
    lives = [Life("config_l1", pid, *life) for pid, life in enumerate(times)]
    judged = history(l1=back((10.0, 3.0)), lives=lives, faults=kill("config_l1", 10.0))
    (found,) = CHECKERS["L1"](judged).evidence
    assert found.cause == "its successor started after 0.50 s"


@pytest.mark.parametrize(("end", "unknown"), [(11.25, 0), (11.5, 1)])
def test_l1_pause_of_the_machine_slows_no_median(end: float, unknown: int) -> None:
    faults = [*kill("config_l1", 10.0), overload(11.0, end)]
    found = CHECKERS["L1"](history(l1=back((10.0, 1.5)), faults=faults))
    assert (found.cases, found.unknown) == (1 - unknown, unknown)


def test_l1_slowest_of_a_hundred_is_not_in_p99() -> None:
    times = [4.0 * n for n in range(1, 101)]
    output = [(at - 0.5, 0.0) for at in times] + [(at + (1.5 if at == 4.0 else 0.375), 0.0) for at in times]
    found = CHECKERS["L1"](history(end=404.0, l1=output, faults=kill("config_l1", *times)))
    assert (found.measured, found.worst) == ("p50 0.50 s, p99 0.50 s", 1.625)


@pytest.mark.parametrize("promise", ["L1", "L4"])
def test_promise_about_durations_without_cases_has_no_figures(promise: str) -> None:
    assert CHECKERS[promise](history()) == Finding(promise, 0, "", [])


def test_l1_silence_for_good_after_any_fault_is_evidence() -> None:
    silent = replace(
        history(
            l1=steps(0, 40, value=0.0),
            l2=steps(0, 29, value=0.0),
            faults=[
                stopped("config_l1", 1.0, 31.0),  # the record ends before its outcome
                stopped(ALL, 29.0, 30.0, "kill_supervisor"),
                stopped(NO_TARGET, 5.0, 5.0, "flood"),
                stopped("config_l1", 6.0, 6.0, "terminate"),
            ],
        ),
        programs=("config_l1", "config_l2"),
    )
    assert CHECKERS["L1"](silent).evidence == [
        Evidence(40.0, "config_l2 is silent for 10 s after kill_supervisor")
    ]


def test_l1_silence_that_another_fault_makes_longer_is_explained() -> None:
    faults = [stopped("config_l1", 10.0, 10.0, "terminate"), stopped("config_l1", 12.0, 25.0)]
    assert not CHECKERS["L1"](history(l1=back((10.0, 17.0)), faults=faults)).evidence
    assert CHECKERS["L1"](history(l1=back((10.0, 17.0)), faults=faults[:1])).evidence


@pytest.mark.parametrize(("until", "found"), [(9.0, 0), (11.5, 0), (12.5, 1), (40.0, 1)])
def test_l1_killed_velocity_need_not_return_while_the_arm_stands_still(until: float, found: int) -> None:
    moved = [(at, (min(at, until), 0.0)) for at, _ in stream()]
    speeds = [*steps(0, 9.75, value=0.5), (14.875, 0.0)]
    judged = history(positions=moved, speeds=speeds, faults=[stopped("velocity", 10.0, 10.0, "kill")])
    finding = CHECKERS["L1"](judged)
    assert [each.text for each in finding.evidence] == ["velocity is silent for 5.00 s after SIGKILL"] * found
    assert (finding.cases, finding.unknown) == (found, 1 - found)


@pytest.mark.parametrize(("until", "found"), [(10.0, 0), (11.125, 0), (11.25, 1), (40.0, 1)])
def test_l1_speed_stays_away_while_the_arm_stands_still(until: float, found: int) -> None:
    moved = [(at, (min(at, until), 0.0)) for at, _ in stream()]
    ended = stopped("velocity", 10.0, 10.0, "terminate")
    health = steps(0, 40, 1.0, value=("velocity", 7))
    judged = history(positions=moved, speeds=steps(0, 9.75, value=0.5), health=health, faults=[ended])
    text = "velocity is silent for 10 s after terminate"
    assert CHECKERS["L1"](judged).evidence == [Evidence(20.0, text)] * found
    judged.streams["effector/position"] = []  # nobody knows whether it stands
    assert CHECKERS["L1"](judged).evidence == [Evidence(20.0, text)]


@pytest.mark.parametrize(
    ("ended", "time"),
    [
        (Life("config_l1", 5, 0.0, 9.5), 1.5),
        (Life("config_l1", 5, 0.0, 10.0), 1.5),
        (Life("config_l1", 5, 0.0, 10.5), 1.0),
        (Life("config_l1", 5, 0.0, 11.0), 0.5),
        (Life("config_l1", 5, 0.0, 11.25), 1.5),  # too late to be the death
        (Life("config_l1", 5, 0.0, None), 1.5),
        (Life("config_l1", 6, 0.0, 11.0), 1.5),
        (Life("config_l2", 5, 0.0, 11.0), 1.5),
    ],
)
def test_l1_silence_begins_with_the_death(ended: Life, time: float) -> None:
    faults = [InjectedFault("kill", "config_l1", 10.0, 10.0, 5)]
    assert CHECKERS["L1"](history(l1=back((10.0, 1.5)), lives=[ended], faults=faults)).worst == time


KILLED_LATE = {
    "lives": [Life("config_l1", 5, 0.0, 11.0)],
    "faults": [InjectedFault("kill", "config_l1", 10.0, 10.0, 5)],
}
"""On a busy machine, the process dies one second after the kill."""


def test_l1_message_that_overtakes_another_one_ends_the_silence() -> None:
    judged = history(l1=back((10.0, 1.125)), faults=kill("config_l1", 10.0))
    judged.streams["l1"] = [s._replace(received=13.0) if s.sent == 11.0 else s for s in judged.streams["l1"]]
    assert CHECKERS["L1"](judged).worst == 1.375


@pytest.mark.parametrize(
    ("event", "unknown"),
    [
        (overload(10.25, 10.75), 0),  # before the death
        (overload(13.0, 13.5), 1),
        (stopped("config_l1", 12.75, 12.75, "terminate"), 1),
        (stopped("config_l1", 13.25, 13.25, "terminate"), 0),
    ],
)
def test_l1_only_an_event_between_the_death_and_the_return_excuses_a_silence(
    event: InjectedFault | Condition, unknown: int
) -> None:
    judged = histories.faulty(history(l1=back((10.0, 3.5)), **KILLED_LATE), event)
    found = CHECKERS["L1"](judged)
    assert (len(found.evidence), found.unknown) == (1 - unknown, unknown)


def test_l1_message_of_a_process_that_ends_soon_is_no_return() -> None:
    ended = InjectedFault("terminate", "config_l1", 10.0, 10.0, 5)
    lives = [Life("config_l1", 5, 0.0, 10.5)]
    found = CHECKERS["L1"](history(l1=steps(0, 10.5, value=0.0), lives=lives, faults=[ended]))
    assert found.evidence == [Evidence(20.5, "config_l1 is silent for 10 s after terminate")]


@pytest.mark.parametrize(
    ("other", "unknown"),
    [
        (stopped("config_l1", 7.875, 7.875, "terminate"), 0),
        (stopped("config_l1", 8.0, 8.0, "terminate"), 1),
        (stopped("config_l1", 11.5, 11.5, "terminate"), 1),
        (stopped("config_l1", 11.625, 11.625, "terminate"), 0),
        (stopped("config_l1", 4.0, 4.875), 0),
        (stopped("config_l1", 4.0, 5.0), 1),
        (stopped("config_l1", 0.0, 0.0, "partition"), 1),
        (stopped("config_l2", 10.0, 11.0), 0),
        (stopped(ALL, 10.0, 11.0), 1),
    ],
)
def test_l1_other_fault_that_disturbs_the_return(other: InjectedFault, unknown: int) -> None:
    found = CHECKERS["L1"](history(l1=back((10.0, 1.5)), faults=[*kill("config_l1", 10.0), other]))
    assert (found.cases, found.unknown) == (1 - unknown, unknown)


def test_l1_fault_after_the_return_was_due_excuses_nothing() -> None:
    faults = [*kill("config_l1", 10.0), stopped("config_l1", 12.5, 12.5, "terminate")]
    found = CHECKERS["L1"](history(l1=back((10.0, 3.0)), faults=faults))
    assert (len(found.evidence), found.unknown) == (1, 0)


def test_l1_fault_of_a_needed_program_disturbs_the_return() -> None:
    faults = [*kill("velocity", 10.0), stopped(KINEMATICS, 10.0, 10.0, "terminate")]
    assert CHECKERS["L1"](history(speeds=back((10.0, 1.5)), faults=faults)).unknown == 1


def test_l1_dead_source_does_not_excuse_a_program_that_starts_without_it() -> None:
    found = CHECKERS["L1"](history(speeds=back((10.0, 3.0)), faults=kill("velocity", 10.0)))
    assert (len(found.evidence), found.unknown) == (1, 0)


@pytest.mark.parametrize(
    ("silent", "length", "unknown"), [(8.5, 2.0, 1), (11.0, 2.0, 1), (10.0, 2.0, 0), (12.0, 2.0, 0)]
)
def test_l1_source_that_is_away_at_the_kill_or_when_the_return_is_due_excuses_it(
    silent: float, length: float, unknown: int
) -> None:
    sources = {name: back() for name in LINKS} | {"l2": back((silent, length))}
    found = CHECKERS["L1"](history(**sources, positions=back((10.0, 3.0)), faults=kill(KINEMATICS, 10.0)))
    assert (len(found.evidence), found.unknown) == (1 - unknown, unknown)


@pytest.mark.parametrize(("last", "unknown"), [(8.75, 1), (8.875, 0), (10.0, 0)])
def test_l1_needs_output_shortly_before(last: float, unknown: int) -> None:
    output = [(last, 0.0), (11.0, 0.0)]
    assert CHECKERS["L1"](history(l1=output, faults=kill("config_l1", 10.0))).unknown == unknown


@pytest.mark.parametrize(("at", "unknown"), [(34.875, 0), (35.0, 1)])
def test_l1_record_has_to_be_long_enough_for_silence_for_good(at: float, unknown: int) -> None:
    found = CHECKERS["L1"](history(l1=steps(0, 34.75, value=0.0), faults=kill("config_l1", at)))
    assert found.unknown == unknown
    assert [each.text for each in found.evidence] == (
        [] if unknown else ["config_l1 is silent for good after SIGKILL"]
    )


# L2

stream = partial(back, period=0.125)


def test_l2_longest_gap_is_that_of_the_other_streams() -> None:
    found = CHECKERS["L2"](
        history(
            l2=stream((5.0, 1.125)),  # before the kills
            theta1=stream((9.875, 0.375)),
            theta2=stream((10.0, 0.5)),
            states=stream((9.25, 1.125)),  # silent before the kill
            faults=kill("config_theta2", 10.0),
        )
    )
    assert found == Finding("L2", 2, "longest gap 250 ms, allowed 250 ms", [], worst=0.25)


def test_l2_gap_within_the_restart_is_evidence_unless_the_observer_missed_it() -> None:
    found = CHECKERS["L2"](
        history(
            l1=stream((10.0, 0.5)),
            l2=stream((10.0, 0.625), (10.5, 0.625)),  # the observer may have missed the first
            theta1=stream((9.75, 1.125)),
            theta2=stream((10.75, 1.125)),  # after the restart
            faults=[*kill("config_l1", 10.0), overload(10.125, 10.375)],
        )
    )
    assert found == Finding(
        "L2",
        2,
        "longest gap 1000 ms, allowed 250 ms",
        [
            Evidence(10.5, "config_l2 is silent for 0.50 s when config_l1 is killed"),
            Evidence(9.75, "config_theta1 is silent for 1.00 s when config_l1 is killed"),
        ],
        1,
        worst=1.0,
    )


@pytest.mark.parametrize("killed", [stream((10.0, 5.0)), []])
@pytest.mark.parametrize(("silent", "found"), [(11.5, 1), (12.5, 0)])
def test_l2_judges_two_seconds_of_a_restart_at_most(
    killed: list[tuple[float, float]], silent: float, found: int
) -> None:
    judged = history(l1=killed, l2=stream((silent, 0.625)), faults=kill("config_l1", 10.0))
    assert len(CHECKERS["L2"](judged).evidence) == found


def test_l2_judges_a_restart_until_the_return() -> None:
    judged = history(l1=stream((10.0, 2.5)), l2=stream((11.75, 0.625)), **KILLED_LATE)
    assert [each.time for each in CHECKERS["L2"](judged).evidence] == [11.75]


@pytest.mark.parametrize(
    ("other", "cases"),
    [
        (stopped("config_l2", 6.875, 6.875, "terminate"), 1),
        (stopped("config_l2", 7.0, 7.0, "terminate"), 0),
        (stopped("config_l2", 10.75, 10.75, "terminate"), 0),
        (stopped("config_l2", 10.875, 10.875, "terminate"), 1),
        *((stopped("config_l2", 4.0, 4.5, kind), 0) for kind in ("stop", "hang", "hog", "slow")),
        *(
            (stopped("config_l2", 4.0, 4.5, kind), 0)
            for kind in ("crash_loop", "kill_all", "kill_supervisor")
        ),
    ],
)
def test_l2_stream_that_another_fault_disturbs_is_no_case(other: InjectedFault, cases: int) -> None:
    messages = {"l1": stream((10.0, 0.5)), "l2": stream()}
    assert CHECKERS["L2"](history(**messages, faults=[*kill("config_l1", 10.0), other])).cases == cases


@pytest.mark.parametrize(("program", "gaps"), [("robot_state", 0), ("velocity", 0), ("config_l2", 1)])
def test_l2_state_and_speed_wait_for_values_after_a_step_of_the_clock(program: str, gaps: int) -> None:
    topic = {"robot_state": "joint_states", "velocity": "speeds", "config_l2": "l2"}[program]
    faults = [*kill("config_l1", 10.0), InjectedFault(STEP, NO_TARGET, 10.0, 10.0)]
    found = CHECKERS["L2"](history(**{"l1": stream((10.0, 0.5)), topic: stream((10.0, 0.5))}, faults=faults))
    assert [program in each.text for each in found.evidence] == [True] * gaps
    assert found.unknown == 1 - gaps


@pytest.mark.parametrize("moves", [False, True])
def test_l2_speed_need_not_be_published_while_the_arm_stands_still(moves: bool) -> None:
    speeds = stream((10.0, 0.5))
    heard = [(at, (1.0, 0.0)) for at, _ in stream()]
    if moves:
        heard = [(at, (at, 0.0)) for at, _ in heard]
    found = CHECKERS["L2"](
        history(l1=stream((10.0, 0.5)), positions=heard, speeds=speeds, faults=kill("config_l1", 10.0))
    )
    silent = [each for each in found.evidence if "velocity" in each.text]
    assert len(silent) == moves, found


# L3


def positions(*wrong: float) -> list[tuple[float, tuple[float, float]]]:
    """Return positions with a silence after each restart at 4, 12, 20 and 28 s, wrong at these times."""
    heard = [at for at, _ in back(*((at, 0.625) for at in (4.0, 12.0, 20.0, 28.0)))]
    return [(at, (5.0, 0.0) if at in wrong else (2.0, 0.0)) for at in heard]


def test_l3_judges_the_last_position_of_a_second() -> None:
    found = CHECKERS["L3"](
        history(
            **LINKS | {"l1": [(0.0, 1.0), (2.0, 1.0), (34.5, 1.0)]},
            positions=positions(6.0, 14.0, 22.0),
            speeds=back((20.0, 0.5)),
            faults=[
                *kill(KINEMATICS, 4.0, 12.0, 20.0, 28.0),
                *kill("config_l1", 1.5, 35.0, 36.0),  # without output before, after, and before
                *kill("velocity", 20.0),
                overload(5.875, 5.9375),
                overload(21.875, 21.9375),
            ],
        )
    )
    assert found == Finding(
        "L3",
        2,
        "right after 1 of 2 returns",
        [Evidence(14.0, "the position does not follow from the last values after kill of kinematics")],
        2,
    )


@pytest.mark.parametrize(
    ("target", "begin", "newest", "unknown"),
    [
        ("config_l1", 4.49, 4.5, 1),
        ("config_l1", 4.51, 4.5, 1),
        ("config_l1", 4.475, 4.5, 0),
        ("config_l1", 4.525, 4.5, 1),  # the record may lack one
        ("config_l1", 4.5, 5.0, 0),  # a newer value has come since
        ("config_l1", 4.5, 6.5, 1),  # after the position
        ("config_l2", 4.5, 4.5, 1),
        ("velocity", 4.5, 4.5, 0),
    ],
)
def test_l3_value_that_a_fault_cuts_off_while_it_is_sent_is_unknown(
    target: str, begin: float, newest: float, unknown: int
) -> None:
    links = {**LINKS, "l1": [(at, 1.0) for at in sorted({0.0, 4.5, newest})]}
    faults = [*kill(KINEMATICS, 4.0), stopped(target, begin, 39.0)]
    found = CHECKERS["L3"](history(**links, positions=positions(6.0), faults=faults))
    assert (found.unknown, len(found.evidence)) == (unknown, 1 - unknown)


def test_l3_value_that_is_sent_after_the_position_explains_nothing() -> None:
    faults = [*kill(KINEMATICS, 4.0), stopped("config_l1", 6.5, 39.0)]
    links = {**LINKS, "l1": [(6.5, 1.0)]}
    found = CHECKERS["L3"](history(**links, positions=positions(6.0), faults=faults))
    assert (found.unknown, len(found.evidence)) == (0, 1)


@pytest.mark.parametrize(("at", "cases"), [(5.5, 1), (6.125, 1), (6.25, 2), (13.25, 1)])
def test_l3_disturbed_return_is_no_case(at: float, cases: int) -> None:
    faults = [*kill(KINEMATICS, 4.0, 12.0), stopped(KINEMATICS, at, at, "double")]
    assert CHECKERS["L3"](history(**LINKS, positions=positions(), faults=faults)).cases == cases


def test_l3_position_has_to_be_right_half_a_second_after_the_return() -> None:
    killed = InjectedFault("kill", KINEMATICS, 4.0, 4.0, 5)
    judged = history(
        **LINKS,
        positions=[each for each in positions(6.0) if not 4.5 < each[0] < 5.5],
        lives=[Life(KINEMATICS, 5, 0.0, 5.0)],
        faults=[killed],
    )
    found = CHECKERS["L3"](judged)
    assert (found.cases, found.evidence) == (1, [])


@pytest.mark.parametrize(("kind", "cases"), [("terminate", 1), ("raise", 1), ("stop", 1), ("double", 0)])
def test_l3_kinds_of_faults(kind: str, cases: int) -> None:
    faults = [stopped(KINEMATICS, 4.0, 9.0, kind)]
    found = CHECKERS["L3"](history(**LINKS, positions=positions(6.0), faults=faults))
    assert (found.cases, len(found.evidence)) == (cases, cases)


@pytest.mark.parametrize("kind", ["stop", "pause", "hang", "hog", "slow"])
def test_l3_message_that_was_under_way_is_no_return(kind: str) -> None:
    heard = [at for at, _ in steps(0, 40) if not 4.25 < at < 5.5]
    judged = history(
        **LINKS,
        positions=[(at, (5.0, 0.0) if at == 5.75 else (2.0, 0.0)) for at in heard],
        lives=[Life(KINEMATICS, 7, 0.0, 5.5 if kind == "hang" else None)],
        faults=[InjectedFault(kind, KINEMATICS, 4.0, 5.5, 7)],
    )
    found = CHECKERS["L3"](judged)
    assert (found.cases, found.evidence) == (1, [])


@pytest.mark.parametrize(("at", "cases"), [(5.5, 0), (6.25, 1)])
def test_l3_return_of_a_source_is_no_case_while_kinematics_is_away(at: float, cases: int) -> None:
    links = LINKS | {"l1": [(sent, 1.0) for sent, _ in back((4.0, 0.625))]}
    faults = [*kill("config_l1", 4.0), stopped(KINEMATICS, at, at, "double")]
    assert CHECKERS["L3"](history(**links, positions=positions(), faults=faults)).cases == cases


# L4


def test_l4_counts_hangs_that_last() -> None:
    found = CHECKERS["L4"](
        history(
            l1=back((10.0, 5.0)),
            l2=back((10.0, 5.5)),
            health=[(16.0, ("sentinel", 7))],  # too late
            faults=[
                stopped("config_l1", 2.0, 4.0),  # too short
                stopped(OPERATOR, 3.0, 9.0),
                stopped("config_theta1", 3.0, 9.0),  # without output before
                stopped("config_theta2", 3.0, 9.0),
                stopped("config_l1", 20.0, 30.0, "slow"),
                stopped("config_l1", 10.0, 15.0),
                stopped("config_l2", 10.0, 20.0, "hang"),
            ],
        )
    )
    assert found == Finding(
        "L4",
        2,
        "replaced within 5.50 s, allowed 5 s",
        [Evidence(10.0, "config_l2 hangs and is silent for 5.50 s", "sentinel was silent, too")],
        2,
        {"config_l1": [5.0], "config_l2": [5.5]},
        5.5,
    )


def test_l4_hang_begins_with_the_fault_and_not_with_the_death() -> None:
    lives = [Life("config_l1", 7, 0.0, 10.5), Life("config_l1", 8, 10.5, None)]
    faults = [InjectedFault("stop", "config_l1", 10.0, 20.0, 7)]
    assert CHECKERS["L4"](history(l1=back((10.0, 1.5)), lives=lives, faults=faults)).worst == 1.5


@pytest.mark.parametrize(("end", "unknown"), [(11.375, 0), (11.5, 1), (12.0, 1)])
def test_l4_is_unknown_if_only_a_pause_of_the_machine_made_it_late(end: float, unknown: int) -> None:
    faults = [stopped("config_l1", 10.0, 20.0), overload(11.0, end)]
    found = CHECKERS["L4"](history(l1=back((10.0, 5.5)), faults=faults))
    assert (found.cases, found.unknown, len(found.evidence)) == (1 - unknown, unknown, 1 - unknown)


@pytest.mark.parametrize(
    ("other", "unknown"),
    [
        (kill("sentinel", 9.0), 0),
        (kill("sentinel", 9.5), 1),
        (kill("sentinel", 12.0), 1),
        (kill("sentinel", 12.5), 0),
        (kill(ALL, 9.5), 1),
        (kill("config_l2", 11.0), 0),
    ],
)
def test_l4_is_unknown_if_the_sentinel_was_hit_meanwhile(other: list[InjectedFault], unknown: int) -> None:
    found = CHECKERS["L4"](history(l1=back((10.0, 2.0)), faults=[stopped("config_l1", 10.0, 20.0), *other]))
    assert (found.cases, found.unknown) == (1 - unknown, unknown)


@pytest.mark.parametrize(("silent", "unknown"), [(15.5, 0), (14.5, 1)])
def test_l4_is_unknown_if_the_successor_waits_for_a_source(silent: float, unknown: int) -> None:
    sources = {name: back() for name in LINKS} | {"l2": back((silent, 3.0))}
    found = CHECKERS["L4"](
        history(**sources, positions=back((10.0, 8.0)), faults=[stopped(KINEMATICS, 10.0, 20.0)])
    )
    assert (found.cases, found.unknown, len(found.evidence)) == (1 - unknown, unknown, 1 - unknown)


@pytest.mark.parametrize(("began", "unknown"), [(9.0, 0), (9.5, 1), (11.5, 1), (12.0, 0)])
def test_l4_is_unknown_if_the_sentinel_is_new_meanwhile(began: float, unknown: int) -> None:
    lives = two_lives("sentinel", began)
    found = CHECKERS["L4"](
        history(l1=back((10.0, 2.0)), lives=lives, faults=[stopped("config_l1", 10.0, 20.0)])
    )
    assert (found.cases, found.unknown) == (1 - unknown, unknown)
