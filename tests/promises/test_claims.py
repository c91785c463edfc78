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
    NO_TARGET,
    RIVAL,
    SWITCH,
    WATCHDOG,
    Condition,
    InjectedFault,
    Life,
)

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
    lives = (Life("drive", 7, 0.0, 2.1), Life("drive", 8, 2.5, None))
    (found,) = claims.driven_time_never_goes_back(history(lives=lives, driven_time=times))
    assert found.words == "the driven time goes back by 1.50 s: process 8 lives since 2.50 s"


def test_drives_of_two_hosts_stand_at_different_times() -> None:
    times = [(1.0, (9.0, HERE)), (1.1, (0.5, THERE)), (1.2, (9.0, HERE)), (1.3, (0.5, THERE))]
    assert not texts(claims.driven_time_never_goes_back(history(driven_time=times)))


def driven(begin: float, end: float) -> list[tuple[float, Any]]:
    """Return the times of a drive that runs between two times."""
    return [(at, (min(max(at, begin), end), HERE)) for at, _ in repeated(None, 0.0, 20.0, 0.05)]


ON_AND_OFF = [*repeated(OFF, 0.0, 4.9), *repeated(ON, 5.0, 9.9), *repeated(OFF, 10.0, 20.0)]
ON_AND_SILENCE = ON_AND_OFF[:100]


@pytest.mark.parametrize(
    ("states", "begin", "end", "first"),
    [
        (ON_AND_OFF, 5.4, 10.0, ""),
        (ON_AND_OFF, 5.4, 10.1, ""),  # a message needs some time
        (ON_AND_OFF, 5.4, 10.25, "the drive runs 0.05 s after an off"),
        (ON_AND_OFF, 5.1, 10.0, "the drive runs 0.05 s after an on"),  # the last off was 0.2 s before
        (ON_AND_SILENCE, 5.4, 10.3, ""),
        (ON_AND_SILENCE, 5.4, 10.4, "the drive runs 0.45 s after an on"),
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
        (InjectedFault("bad_line", "all", 9.0, 11.0), False),
        (Condition("overload", 10.0, 11.0), False),
    ],
)
def test_drive_that_was_away_may_report_a_time_later(event: InjectedFault | Condition, found: bool) -> None:
    judged = history(faults=[event], states=ON_AND_OFF, driven_time=driven(5.4, 10.3))
    assert bool(texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))) is found


def test_new_drive_does_not_know_an_off_of_before() -> None:
    judged = history(states=ON_AND_OFF, driven_time=driven(5.1, 10.0), lives=(Life(DRIVE, 7, 5.0, None),))
    assert not texts(claims.drive_runs_by_a_young_on(judged, effects(judged)))


@pytest.mark.parametrize(
    ("began", "end", "found"), [(9.95, 10.25, False), (9.95, 10.35, True), (9.5, 10.25, True)]
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
        (40.4, {}, False),  # and has left
        (20.0, {"states": [*repeated(OFF, 0.0, 20.0), *repeated(ON, 20.1, 40.0)]}, False),
        (20.0, {"commands": [(20.0, TURN_ON), (20.1, TURN_OFF)], "operator_activity": [(1.0, ALIVE)]}, False),
    ],
)
def test_present_operator_who_is_not_obeyed_is_found(at: float, extra: dict[str, Any], found: bool) -> None:
    judged = history(**{"heartbeats": BEATS, "states": IDLE, "commands": [(at, TURN_ON)], **extra})
    text = "a turn_on of a present operator turned nothing on, and the operator was not reported"
    assert texts(claims.present_operator_is_obeyed(judged, effects(judged))) == [text] * found


@pytest.mark.parametrize("program", [SWITCH, WATCHDOG, CONTROLLER])
def test_present_operator_need_not_be_obeyed_by_the_dead(program: str) -> None:
    killed = InjectedFault("kill", program, 19.0, 19.0)
    judged = history(faults=[killed], heartbeats=BEATS, states=IDLE, commands=[(20.0, TURN_ON)])
    assert not texts(claims.present_operator_is_obeyed(judged, effects(judged)))


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
        ((4.2, 4.2, 4.2), True),
        ((4.2, 1.0, 4.2, 4.2), True),
        ((4.2, 4.2), False),
        ((4.2, 4.2, 4.0), False),  # it may have been none
        ((7.2, 4.2), True),
    ],
)
def test_strikes_that_turn_nothing_off_are_found(lasting: tuple[float, ...], found: bool) -> None:
    judged = history(heartbeats=silences(*lasting), states=repeated(ON, 0.0, 60.0))
    assert bool(texts(claims.last_strike_stops(judged, effects(judged)))) is found


@pytest.mark.parametrize(
    ("extra", "lives", "faults"),
    [
        ({"commands": [(18.0, TURN_OFF)]}, (), ()),
        ({"states": repeated(OFF, 0.0, 60.0)}, (), ()),
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


# The end of a process


@pytest.mark.parametrize(
    ("event", "ended", "found"),
    [
        (InjectedFault("kill", "velocity", 20.0, 20.0), 20.1, False),
        (InjectedFault("kill", "velocity", 20.0, 20.0), 19.0, True),
        (InjectedFault("kill", "velocity", 20.0, 20.0), 50.0, True),
        (InjectedFault("kill", "kinematics", 20.0, 20.0), 20.1, True),
        (InjectedFault("kill_all", "all", 20.0, 20.0), 20.1, False),
        (InjectedFault("babble", "nothing", 10.0, 20.0), 20.1, False),
        (Condition("overload", 20.0, 21.0), 20.1, False),
        (Condition("overload", 20.0, 21.0), 23.0, True),
    ],
)
def test_process_that_ends_without_a_cause_is_found(
    event: InjectedFault | Condition, ended: float, found: bool
) -> None:
    judged = history(faults=[event], lives=(Life("velocity", 7, 0.0, ended),))
    expected = ["process 7 of velocity ended without a cause"] * found
    assert texts(claims.ends_have_causes(judged, effects(judged))) == expected


def test_second_instance_ends_because_of_the_first() -> None:
    lives = Life("velocity", 7, 0.0, None), Life("velocity", 8, 20.0, 20.5)
    judged = history(lives=lives)
    assert not texts(claims.ends_have_causes(judged, effects(judged)))


def test_programs_of_others_end_as_they_like() -> None:
    judged = history(lives=(Life("babbler", 7, 0.0, 20.0), Life("", 8, 0.0, 20.0)))
    assert not texts(claims.ends_have_causes(judged, effects(judged)))
