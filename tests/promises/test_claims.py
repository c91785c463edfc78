"""What contradicts a claim of deploy/SAFETY.md in a history, and what does not."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from interfaces.topics import ALIVE, OFF, ON, TURN_OFF, TURN_ON
from tests.promises import claims
from tests.promises.effects import effects
from tests.promises.history import (
    CONTROLLER,
    DRIVE,
    HOLD,
    LOSE,
    NO_TARGET,
    RIVAL,
    SWITCH,
    WATCHDOG,
    Condition,
    InjectedFault,
    Life,
)
from tests.promises.marks import STEP

from . import histories

HERE, THERE = "host", "another host"


history = partial(histories.history, end=60.0)


def repeated(value: Any, begin: float, end: float, step: float = 0.1) -> list[tuple[float, Any]]:
    return [(round(begin + n * step, 3), value) for n in range(1 + round((end - begin) / step))]


def texts(found: Any) -> list[str]:
    return [each.text for each in found]


# The driven time


def test_driven_time_that_goes_back_is_found() -> None:
    times = [(1.0, (0.5, HERE)), (2.0, (1.5, HERE)), (3.0, (0.0, HERE)), (4.0, (1.0, HERE))]
    lives = (Life("drive", 7, 0.0, 2.1), Life("drive", 8, 2.5, 4.5), Life("drive", 9, 4.5, None))
    (found,) = claims.driven_time_never_goes_back(history(lives=lives, driven_time=times))
    assert found.words == "the driven time goes back by 1.50 s: process 8 lives since 2.50 s"


def test_drives_of_two_hosts_stand_at_different_times() -> None:
    times = [(1.0, (9.0, HERE)), (1.1, (0.5, THERE)), (1.2, (9.0, HERE)), (1.3, (0.5, THERE))]
    judged = history(driven_time=times)
    assert not texts(claims.driven_time_never_goes_back(judged))
    assert not texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))


def driven(begin: float, end: float) -> list[tuple[float, Any]]:
    """Return the times of a drive that runs between two times."""
    return [(at, (min(max(at, begin), end), HERE)) for at, _ in repeated(None, 0.0, 20.0, 0.05)]


ON_AND_OFF = [*repeated(OFF, 0.0, 4.9), *repeated(ON, 5.0, 9.9), *repeated(OFF, 10.0, 20.0)]
ON_AND_SILENCE = ON_AND_OFF[:100]
OFF_UNTIL_4_7 = [each for each in ON_AND_OFF if each[0] <= 4.7 or each[1] == ON]


@pytest.mark.parametrize(
    ("states", "begin", "end", "first"),
    [
        (ON_AND_OFF, 5.4, 10.0, ""),
        (ON_AND_OFF, 5.4, 10.1, ""),  # a message needs some time
        (ON_AND_OFF, 5.4, 10.25, "the drive runs 0.05 s after an off"),
        (ON_AND_OFF, 5.1, 10.0, "the drive runs 0.05 s after an on"),  # the last off was 0.2 s before
        (ON_AND_SILENCE, 5.4, 10.3, ""),
        (ON_AND_SILENCE, 5.4, 10.4, "the drive runs 0.45 s after an on"),
        (repeated(ON, 4.995, 9.895), 5.4, 10.3, ""),  # what happens at once may be sent in either order
        (OFF_UNTIL_4_7, 5.1, 10.0, ""),  # the last off may have come 0.15 s sooner than the first on
        ([], 5.4, 10.0, "the drive runs without any state"),
    ],
)
def test_drive_that_runs_on_is_found(
    states: list[tuple[float, Any]], begin: float, end: float, first: str
) -> None:
    judged = history(states=states, driven_time=driven(begin, end))
    found = texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))
    assert found[:1] == [first] * bool(first)


@pytest.mark.parametrize(
    ("event", "found"),
    [
        (InjectedFault("stop", "velocity", 9.0, 9.5), True),
        (InjectedFault("stop", DRIVE, 10.0, 11.0), False),  # it published an earlier time
        (InjectedFault("kill", DRIVE, 10.0, 10.0), False),
        (InjectedFault("bad_line", "all", 9.0, 11.0), False),
        (Condition("overload", 10.0, 11.0), False),
    ],
)
def test_drive_that_was_away_may_report_a_time_later(event: InjectedFault | Condition, found: bool) -> None:
    judged = history(faults=[event], states=ON_AND_OFF, driven_time=driven(5.4, 10.3))
    assert bool(texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))) is found


@pytest.mark.parametrize("program", [DRIVE, CONTROLLER])
@pytest.mark.parametrize(("began", "found"), [(5.0, False), (3.0, True)])
def test_new_drive_does_not_know_an_off_of_before_nor_of_a_new_controller(
    program: str, began: float, found: bool
) -> None:
    lives = (Life(program, 7, began, None),)
    judged = history(states=ON_AND_OFF, driven_time=driven(5.1, 10.0), lives=lives)
    assert bool(texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))) is found


@pytest.mark.parametrize(
    ("began", "end", "found"),
    [(9.95, 10.25, False), (9.89, 10.25, False), (9.95, 10.35, True), (9.5, 10.25, True)],
)
def test_drive_may_not_know_a_new_controller_that_says_off(began: float, end: float, found: bool) -> None:
    lives = Life(CONTROLLER, 7, 0.0, began), Life(CONTROLLER, 8, began, None)
    judged = history(states=ON_AND_OFF, driven_time=driven(5.4, end), lives=lives)
    assert bool(texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))) is found


@pytest.mark.parametrize(("began", "found"), [(9.95, False), (8.0, True)])
def test_drive_may_not_know_a_rival_that_has_come_just_now(began: float, found: bool) -> None:
    rival = InjectedFault(RIVAL, NO_TARGET, began, 20.0)
    both = sorted([*repeated(ON, 5.0, 20.0), *repeated(OFF, 10.0, 20.0)])
    judged = history(faults=[rival], states=both, driven_time=driven(5.4, 10.35))
    assert bool(texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))) is found


def test_one_host_of_two_does_not_show_the_other_controller() -> None:
    judged = replace(history(driven_time=driven(5.4, 10.0)), programs=(CONTROLLER, DRIVE))
    assert not texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))


# A `turn_on` of a present operator

BEATS = repeated(True, 0.0, 40.0, 0.05)
IDLE = repeated(OFF, 0.0, 40.0)


@pytest.mark.parametrize(
    ("at", "extra", "found"),
    [
        (20.0, {}, True),
        (1.0, {}, False),  # the operator has come just now
        (0.6, {"health": [(0.0, (WATCHDOG, 7, ("lifespan", 4.7)))]}, False),
        (20.0, {"health": [(0.0, (WATCHDOG, 7, ("lifespan", 4.7)))]}, True),
        (40.4, {}, False),  # and has left
        (20.0, {"states": [*repeated(OFF, 0.0, 20.0), *repeated(ON, 20.1, 40.0)]}, False),
        (20.0, {"commands": [(20.0, TURN_ON), (20.1, TURN_OFF)], "operator_activity": [(1.0, ALIVE)]}, False),
        (20.0, {"commands": [(19.9, TURN_OFF), (20.0, TURN_ON)]}, True),  # of the watchdog
        (20.0, {"states": [*repeated(ON, 0.0, 19.5), *repeated(OFF, 19.6, 40.0)]}, True),
        (20.0, {"presences": [(20.1, 20.1)]}, True),
        (20.0, {"end": 20.2}, False),
        (20.0, {"health": [(0.0, (SWITCH, 7, ("rate", 1.0)))]}, False),
    ],
)
def test_present_operator_who_is_not_obeyed_is_found(at: float, extra: dict[str, Any], found: bool) -> None:
    judged = history(**{"heartbeats": BEATS, "states": IDLE, "commands": [(at, TURN_ON)], **extra})
    text = "a turn_on of a present operator turned nothing on, and the operator was not reported"
    assert texts(claims.present_operator_is_obeyed(judged, effects(judged))) == [text] * found


@pytest.mark.parametrize(
    ("pause", "oldest", "found"), [(0.05, 0.8, True), (0.4, 0.8, False), (0.4, 1.2, True)]
)
def test_operator_need_not_be_obeyed_between_two_reports(pause: float, oldest: float, found: bool) -> None:
    beats = [beat for beat in BEATS if not 20.01 - pause < beat[0] < 20.01]
    health = [(0.0, (CONTROLLER, 7, ("max_presence_age", oldest)))]
    judged = history(heartbeats=beats, states=IDLE, commands=[(20.0, TURN_ON)], health=health)
    assert bool(texts(claims.present_operator_is_obeyed(judged, effects(judged)))) is found


@pytest.mark.parametrize("program", [SWITCH, WATCHDOG, CONTROLLER])
@pytest.mark.parametrize(("at", "found"), [(19.0, False), (14.0, False), (13.0, True)])
def test_present_operator_need_not_be_obeyed_by_the_dead(program: str, at: float, found: bool) -> None:
    killed = InjectedFault("kill", program, at, at)
    judged = history(faults=[killed], heartbeats=BEATS, states=IDLE, commands=[(20.0, TURN_ON)])
    assert bool(texts(claims.present_operator_is_obeyed(judged, effects(judged)))) is found


@pytest.mark.parametrize(
    ("event", "found"),
    [
        (InjectedFault("kill", "velocity", 19.0, 19.0), True),
        (InjectedFault(STEP, NO_TARGET, 19.5, 19.5), False),
        (InjectedFault(HOLD, "operator_presence", 19.0, 20.0), False),
        (InjectedFault(LOSE, "engines", 19.0, 19.5), False),
        (InjectedFault(RIVAL, NO_TARGET, 19.0, 19.5), False),
        (Condition("overload", 19.0, 19.5), False),
        (Condition("loss", 19.0, 19.5), False),
        (Condition("silence", 19.0, 19.5), True),  # it sends heartbeats nevertheless
    ],
)
def test_present_operator_need_not_be_obeyed_by_those_who_may_not_know_it(
    event: InjectedFault | Condition, found: bool
) -> None:
    judged = history(faults=[event], heartbeats=BEATS, states=IDLE, commands=[(20.0, TURN_ON)])
    assert bool(texts(claims.present_operator_is_obeyed(judged, effects(judged)))) is found


@pytest.mark.parametrize(
    ("program", "began", "found"),
    [
        (WATCHDOG, 19.0, False),
        (WATCHDOG, 12.5, True),
        (CONTROLLER, 19.0, False),
        (SWITCH, 12.5, False),  # the observer may have missed a `turn_off`
        (SWITCH, 11.5, True),
    ],
)
def test_present_operator_need_not_be_obeyed_by_the_new(program: str, began: float, found: bool) -> None:
    lives = (Life(program, 7, began, None),)
    judged = history(lives=lives, heartbeats=BEATS, states=IDLE, commands=[(20.0, TURN_ON)])
    assert bool(texts(claims.present_operator_is_obeyed(judged, effects(judged)))) is found


# The last strike


def silences(*lasting: float) -> list[tuple[float, Any]]:
    """Return heartbeats with silences, each after two seconds with an operator."""
    beats, at = [], 0.0
    for each in lasting:
        beats += repeated(True, at, at + 2.0, 0.05)
        at += 2.0 + each
    return [*beats, *repeated(True, at, 60.0, 0.05)]


@pytest.mark.parametrize(
    ("lasting", "found"),
    [
        ((4.2, 4.2, 4.2), 1),
        ((4.2, 1.0, 4.2, 4.2), 1),
        ((4.2, 4.2), 0),
        ((4.2, 4.2, 4.1), 0),  # it may have been none
        ((7.2, 4.2), 1),
        ((4.2,) * 5, 1),
        ((4.2,) * 6, 2),
    ],
)
def test_strikes_that_turn_nothing_off_are_found(lasting: tuple[float, ...], found: int) -> None:
    judged = history(heartbeats=silences(*lasting), states=repeated(ON, 0.0, 60.0))
    assert len(texts(claims.last_strike_stops(judged, effects(judged)))) == found


@pytest.mark.parametrize(
    ("extra", "lives", "faults"),
    [
        ({"commands": [(18.0, TURN_OFF)]}, (), ()),
        ({"commands": [(7.0, TURN_OFF)]}, (), ()),  # between two of them
        ({"states": repeated(OFF, 0.0, 60.0)}, (), ()),
        ({"states": [*repeated(ON, 0.0, 18.6), *repeated(OFF, 18.75, 60.0)]}, (), ()),
        ({"heartbeats": [beat for beat in silences(4.2, 4.2, 4.2) if beat[0] > 5.0]}, (), ()),
        ({}, (Life(WATCHDOG, 7, 9.0, None),), ()),
        ({}, (), (InjectedFault("stop", WATCHDOG, 9.0, 10.0),)),
        ({}, (), (InjectedFault("kill", CONTROLLER, 18.0, 18.0),)),
    ],
)
def test_strikes_count_for_a_watchdog_that_has_seen_them(
    extra: dict[str, Any], lives: tuple[Life, ...], faults: tuple[InjectedFault, ...]
) -> None:
    given = {"heartbeats": silences(4.2, 4.2, 4.2), "states": repeated(ON, 0.0, 60.0), **extra}
    judged = history(faults=faults, lives=lives, **given)
    assert not texts(claims.last_strike_stops(judged, effects(judged)))


@pytest.mark.parametrize(("commands", "found"), [((7.0,), True), ((7.0, 9.0), False)])
def test_strikes_after_the_last_command_count(commands: tuple[float, ...], found: bool) -> None:
    beats, states = silences(4.2, 4.2, 4.2, 4.2), repeated(ON, 0.0, 60.0)
    judged = history(heartbeats=beats, states=states, commands=[(at, TURN_OFF) for at in commands])
    text = "3 silences since 8.20 s have not turned the engines off"
    assert texts(claims.last_strike_stops(judged, effects(judged))) == [text] * found


# The end of a process


@pytest.mark.parametrize(
    ("event", "ended", "found"),
    [
        (InjectedFault("kill", "velocity", 20.0, 20.0), 20.1, False),
        (InjectedFault("kill", "velocity", 20.0, 20.0), 19.995, False),  # sent in either order
        (InjectedFault("kill", "velocity", 20.0, 20.0), 19.0, True),
        (InjectedFault("stop", "velocity", 10.0, 20.0), 44.0, False),
        (InjectedFault("stop", "velocity", 10.0, 20.0), 46.0, True),
        (InjectedFault("hang", "velocity", 10.0, 20.0, 7), 50.0, False),  # it hangs until it ends
        (InjectedFault("hang", "velocity", 10.0, 20.0, 9), 50.0, True),
        (InjectedFault("kill", "velocity", 20.0, 20.0), 50.0, True),
        (InjectedFault("kill", "kinematics", 20.0, 20.0), 20.1, True),
        (InjectedFault("kill_all", "all", 20.0, 20.0), 20.1, False),
        (InjectedFault("babble", "nothing", 10.0, 20.0), 20.1, False),
        (InjectedFault("partition", "operator", 10.0, 20.0), 20.1, False),
        (InjectedFault("kill", "velocity", 20.0, 20.0), 60.0, False),  # when the record ends
        (Condition("overload", 20.0, 21.0), 20.1, False),
        (Condition("overload", 20.0, 21.0), 21.5, False),  # it may hide a kill
        (Condition("overload", 20.0, 21.0), 23.0, True),
    ],
)
def test_process_that_ends_without_a_cause_is_found(
    event: InjectedFault | Condition, ended: float, found: bool
) -> None:
    lives = Life("velocity", 7, 0.0, ended), Life("kinematics", 8, 0.0, None)
    judged = history(faults=[event], lives=lives)
    expected = ["process 7 of velocity ended without a cause"] * found
    assert texts(claims.ends_have_causes(judged, effects(judged))) == expected


def test_second_instance_ends_because_of_the_first() -> None:
    lives = Life("velocity", 7, 0.0, None), Life("velocity", 8, 20.0, 20.5)
    judged = history(lives=lives)
    assert not texts(claims.ends_have_causes(judged, effects(judged)))


def test_successor_is_no_second_instance() -> None:
    lives = Life("velocity", 7, 0.0, 10.11), Life("velocity", 8, 10.1, 20.5)
    judged = history(lives=lives)
    assert texts(claims.ends_have_causes(judged, effects(judged))) == [
        f"process {pid} of velocity ended without a cause" for pid in (7, 8)
    ]


def test_programs_of_others_end_as_they_like() -> None:
    judged = history(lives=(Life("babbler", 7, 0.0, 20.0), Life("", 8, 0.0, 20.0)))
    assert not texts(claims.ends_have_causes(judged, effects(judged)))
