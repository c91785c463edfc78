"""The bounds of the checkers, from both sides: a promise holds just within each, and breaks just beyond."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from interfaces.robot_model import forward_kinematics
from interfaces.topics import CONFIGURATION, OFF, ON, TURN_OFF
from tests.promises.findings import HOLDS, VIOLATED
from tests.promises.history import Condition, History, InjectedFault, Life, between
from tests.promises.promises import CHECKERS

from .histories import END, added, change, faulty, good, killed, silent, succeeded, with_value

AT = 20.0  # s, the moment that a bound counts from; every topic has a message then
RARE = 7.25  # m, a length that no topic has otherwise
TRAVEL = 0.001  # s from the source to the observer, in a history made by hand


def resumed(history: History, topic: str, pause: float, begin: float = AT, value: Any = 0.0) -> History:
    return added(silent(history, topic, begin, begin + pause), topic, (begin + pause, value))


def without_operator(history: History) -> History:
    return silent(silent(history, "operator_heartbeat", AT, END), "operator_presence", AT, END)


def engines_turn_off_after(silence: float) -> History:
    history = with_value(without_operator(good()), "engines/state", OFF, AT + silence)
    return added(history, "engines/state", (AT + silence, OFF))


def with_kills(turned_off: Callable[[float], History], *programs: str) -> Callable[[float], History]:
    def build(silence: float) -> History:
        history = turned_off(silence)
        for program in programs:
            history = faulty(history, InjectedFault("kill", program, AT + 4.0, AT + 4.0))
        return history

    return build


def last_on_after(silence: float) -> History:
    history = silent(without_operator(good()), "engines/state", AT + silence - 0.05, END)
    return added(history, "engines/state", (AT + silence, ON))


def turned_off_with_a_presence_before(age: float) -> History:
    history = silent(good(), "operator_heartbeat", 30.0, 45.0)
    history = silent(history, "operator_presence", 30.0, 45.0)
    history = added(history, "operator_heartbeat", (42.0 - age, True))
    history = added(history, "operator_presence", (42.0 - age, 42.0 - age))
    return added(with_value(history, "engines/state", OFF, 42.0), "engines/state", (42.0, OFF))


def turned_off_after_three_silences_of(length: float) -> History:
    history = good()
    for begin in (20.0, 30.0, 40.0):
        history = resumed(history, "operator_heartbeat", length, begin, value=True)
    return added(with_value(history, "engines/state", OFF, 44.0), "engines", (44.05, TURN_OFF))


def turned_off_after_a_command_before(age: float) -> History:
    history = turned_off_after_three_silences_of(4.0)
    return change(history, "engines", lambda s: s if s.sent < 6.0 else s._replace(sent=44.1 - age))


def turned_on_after_a_command_before(age: float) -> History:
    return change(good(), "engines", lambda sample: sample._replace(sent=5.0 - age))


def turned_on_after_a_heartbeat_before(age: float) -> History:
    return added(silent(good(), "operator_heartbeat", 3.0, 6.0), "operator_heartbeat", (5.0 - age, True))


def with_position_of_a_replaced_length(history: History, replaced: float, age: float) -> History:
    """Return the history with a position of a length that was replaced a time [s] before."""
    history = added(history, "l1", (replaced - 0.05, RARE))
    at = replaced + age
    latest = [between(history.streams[name], 0.0, at)[-1].value for name in CONFIGURATION]
    return added(history, "effector/position", (at, forward_kinematics(RARE, *latest[1:])))


def position_of_a_length_replaced_before(age: float) -> History:
    return with_position_of_a_replaced_length(good(), AT, age)


def second_supervisord_for(duration: float) -> History:
    history = good()
    return replace(history, lives=[*history.lives, Life("", 777, AT, AT + duration)])


def back_after(times: int) -> Callable[[float], History]:
    """Return a function to the history in which a killed program is silent for a time [s], as often."""

    def build(silence: float) -> History:
        history = good()
        for at in (40.0, 30.0, 20.0)[:times]:
            history = killed(history, "kinematics", at, silence)
            history = added(history, "effector/position", (at + silence - TRAVEL, (0.0, 0.0)))
        return history

    return build


def silent_after_a_fault_for(silence: float) -> History:
    history = faulty(good(), InjectedFault("terminate", "velocity", AT + 0.01, AT + 0.01))
    return resumed(history, "effector/speed", silence + 0.01)


def stream_pauses_during_a_restart_for(pause: float) -> History:
    return resumed(killed(good(), "kinematics", AT, 0.6), "theta1", pause)


def stream_pauses_while_the_observer_misses(missed: float) -> History:
    history = stream_pauses_during_a_restart_for(0.45)
    return faulty(history, Condition("overload", AT + 0.1, AT + 0.1 + missed))


def last_position_of_a_length_replaced_before(age: float) -> History:
    replaced = 21.5  # kinematics is back at 20.6, and right from 21.1 on
    history = silent(killed(good(), "kinematics", AT, 0.6), "effector/position", replaced + age, replaced + 2)
    return with_position_of_a_replaced_length(history, replaced, age)


def replaced_after(hang: float) -> History:
    history = succeeded(resumed(good(), "effector/position", hang - TRAVEL), "kinematics", AT + hang - 0.5)
    return faulty(history, InjectedFault("stop", "kinematics", AT, AT + 15.0, 105))


BOUNDS: list[tuple[str, Callable[[float], History], float, float]] = [
    # promise, history with a time [s], the longest or shortest time that is allowed, a time beyond
    ("S1", engines_turn_off_after, 10.04, 10.06),
    ("S1", with_kills(engines_turn_off_after, "operator_watchdog"), 10.44, 10.46),
    ("S1", with_kills(engines_turn_off_after, "engine_controller"), 10.44, 10.46),
    ("S1", with_kills(engines_turn_off_after, "kinematics"), 10.04, 10.06),
    ("S1", with_kills(engines_turn_off_after, "operator_watchdog", "engine_controller"), 10.49, 10.51),
    ("S1", with_kills(last_on_after, "operator_watchdog", "engine_controller"), 10.09, 10.11),  # then F3 acts
    ("S2", turned_off_with_a_presence_before, 9.77, 9.73),
    ("S2", turned_off_after_three_silences_of, 2.51, 2.49),
    ("S2", turned_off_after_a_command_before, 0.14, 0.16),
    ("S3", turned_on_after_a_command_before, 1.14, 1.16),
    ("S3", turned_on_after_a_heartbeat_before, 1.14, 1.16),
    ("S4", position_of_a_length_replaced_before, 19.99, 20.01),
    ("S5", second_supervisord_for, 3.99, 4.01),
    ("L1", back_after(times=3), 0.99, 1.01),  # the median
    ("L1", back_after(times=1), 1.99, 2.01),
    ("L1", silent_after_a_fault_for, 9.99, 10.01),
    ("L2", stream_pauses_during_a_restart_for, 0.249, 0.251),
    ("L3", last_position_of_a_length_replaced_before, 0.49, 0.51),
    ("L4", replaced_after, 4.99, 5.01),
]


@pytest.mark.parametrize(("promise", "history", "within", "beyond"), BOUNDS)
def test_promise_holds_within_its_bound_and_breaks_beyond(
    promise: str, history: Callable[[float], History], within: float, beyond: float
) -> None:
    finding = CHECKERS[promise](history(within))
    assert not finding.evidence
    assert finding.unknown == 0
    finding = CHECKERS[promise](history(beyond))
    assert finding.verdict == VIOLATED
    assert finding.unknown == 0


def test_l2_only_recorded_overload_excuses_a_pause() -> None:
    finding = CHECKERS["L2"](stream_pauses_while_the_observer_misses(0.21))
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)
    finding = CHECKERS["L2"](stream_pauses_while_the_observer_misses(0.19))
    assert (finding.verdict, finding.unknown) == (VIOLATED, 0)


def test_l2_pause_of_all_streams_at_once_is_a_violation() -> None:
    history = killed(good(), "kinematics", AT, 0.6)
    for topic in [name for name in history.streams if name not in ("effector/position", "effector/speed")]:
        history = silent(history, topic, AT + 0.05, AT + 0.5)
    assert len(CHECKERS["L2"](history).evidence) == 8
