"""The latch of the engines."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.topics import OFF, ON, TURN_OFF, TURN_ON
from reactive_node.stamps import Timestamp
from services.engine_controller import engine_state

on_next, subscribe = ReactiveTest.on_next, ReactiveTest.subscribe


class Engines:
    """The recipe between a virtual operator and a list of states, with a wall clock that can be set."""

    def __init__(self) -> None:
        self.scheduler = TestScheduler()
        self.clock_is_ahead = timedelta(0)
        self.refusals: list[str] = []

    def now(self) -> datetime:
        return self.scheduler.now + self.clock_is_ahead

    def set_clock(self, at: float, by: float) -> None:
        def action(*_: Any) -> None:
            self.clock_is_ahead += timedelta(seconds=by)

        self.scheduler.schedule_absolute(at, action)

    def run(
        self,
        commands: list[tuple[float, str, float]],
        presences: list[tuple[float, float]],
        until: float = 60.0,
    ) -> list[tuple[float, str]]:
        """
        Return the states and when they change.

        :param commands: when they arrive, what they say, and their source time.
        :param presences: when they arrive, and their stamps.
        """
        return changes(self.states(commands, presences, until))

    def states(
        self, commands: list[tuple[float, str, float]], presences: list[tuple[float, float]], until: float
    ) -> list[tuple[float, str]]:
        self.commands = self.scheduler.create_hot_observable(
            *(on_next(at, Timestamp(command, at_time(source))) for at, command, source in commands)
        )
        self.presences = self.scheduler.create_hot_observable(
            *(on_next(at, at_time(stamp)) for at, stamp in presences)
        )
        results = self.scheduler.start(
            lambda: engine_state(
                self.commands,
                self.presences,
                repeat=1.0,
                drive=4.0,
                now=self.now,
                refused=self.refusals.append,
            ),
            created=0.001,
            subscribed=0.002,
            disposed=until,
        )
        return [(message.time, message.value.value) for message in results.messages]


def at_time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)


def changes(states: list[tuple[float, str]]) -> list[tuple[float, str]]:
    return [
        state for before, state in zip([(0.0, ""), *states], states, strict=False) if state[1] != before[1]
    ]


def seen_until(end: float, begin: float = 0.5) -> list[tuple[float, float]]:
    """The presences of an operator: two a second, each of 0.1 s before."""
    return [(step / 2, step / 2 - 0.1) for step in range(int(begin * 2), int(end * 2) + 1)]


@pytest.fixture
def engines() -> Engines:
    return Engines()


def test_they_start_off_and_the_state_is_repeated(engines: Engines) -> None:
    assert engines.states([], [], 3.5) == [(0.002, OFF), (1.002, OFF), (2.002, OFF), (3.002, OFF)]
    assert engines.commands.subscriptions == [subscribe(0.002, 3.5)]
    assert engines.presences.subscriptions == [subscribe(0.002, 3.5)]


def test_they_go_on_with_the_operator_present_and_off_by_command_at_once(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2), (5.7, TURN_OFF, 5.7)], seen_until(9))

    assert states == [(0.002, OFF), (2.2, ON), (5.7, OFF)]
    assert engines.refusals == []


def test_a_command_that_changes_nothing_is_no_news(engines: Engines) -> None:
    commands = [(at, TURN_OFF, at) for at in (0.1, 0.2, 0.3)]

    assert engines.states(commands, seen_until(2), 1.5) == [(0.002, OFF), (1.002, OFF)]


def test_they_do_not_go_on_while_nobody_was_seen(engines: Engines) -> None:
    assert engines.run([(2.2, TURN_ON, 2.2)], []) == [(0.002, OFF)]
    assert engines.refusals == ["turn_on refused: no operator seen yet"]


def test_they_do_not_go_on_when_the_operator_was_seen_more_than_a_second_ago(engines: Engines) -> None:
    assert engines.run([(4.0, TURN_ON, 4.0)], seen_until(3)) == [(0.002, OFF)]
    assert engines.refusals == ["turn_on refused: no operator seen for 1.100 s"]


def test_a_command_to_turn_on_that_waited_in_a_queue_is_refused(engines: Engines) -> None:
    assert engines.run([(4.2, TURN_ON, 2.2)], seen_until(9)) == [(0.002, OFF)]
    assert engines.refusals == ["turn_on refused: 2.000 s old"]


def test_a_command_to_turn_off_is_obeyed_however_old_it_is(engines: Engines) -> None:
    assert engines.run([(2.2, TURN_ON, 2.2), (4.0, TURN_OFF, -99.0)], seen_until(9))[-1] == (4.0, OFF)


def test_they_go_off_ten_seconds_after_the_last_sight_of_the_operator_and_stay_off(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2)], [*seen_until(5), *seen_until(30, begin=16)])

    assert states == [(0.002, OFF), (2.2, ON), (14.9, OFF)]


def test_an_old_presence_that_arrives_late_is_as_old_as_its_stamp(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2)], [*seen_until(3), (11.0, 3.4)])

    assert states == [(0.002, OFF), (2.2, ON), (13.4, OFF)]


def test_a_presence_from_the_future_or_of_before_the_last_one_counts_for_nothing(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2)], [*seen_until(3), (4.0, 5.0), (5.0, 2.9), (6.0, 2.5)])

    assert states == [(0.002, OFF), (2.2, ON), (12.9, OFF)]
    assert engines.refusals == ["presence: it is stamped by a clock that is 1.000 s ahead of ours"]


@pytest.mark.parametrize("ahead", [0.003, 0.049])
def test_an_operator_whose_clock_is_a_little_ahead_is_seen(engines: Engines, ahead: float) -> None:
    presences = [(at, at + ahead) for at, _ in seen_until(3)]

    states = engines.run([(2.2, TURN_ON, 2.2)], presences)

    assert states == [(0.002, OFF), (2.2, ON), (13.0, OFF)]
    assert engines.refusals == []


@pytest.mark.parametrize("hours", [1.0, -1.0])
def test_setting_the_clock_changes_nothing(engines: Engines, hours: float) -> None:
    engines.set_clock(4.25, by=hours * 3600)
    presences = [(at, stamp + hours * 3600 * (at > 4.25)) for at, stamp in seen_until(20)]

    states = engines.run([(2.2, TURN_ON, 2.2)], presences, until=45.0)

    assert states == [(0.002, OFF), (2.2, ON), (29.9, OFF)]


def test_a_controller_that_was_paused_does_not_renew_what_has_ended_meanwhile(engines: Engines) -> None:
    engines.scheduler.schedule_absolute(10.1, lambda *_: engines.scheduler.sleep(5.0))
    states = engines.states([(1.2, TURN_ON, 1.2)], [(1.0, 1.0)], 20.0)
    assert ON in {state for time, state in states if time < 10.15}
    assert {state for time, state in states if time > 10.15} == {OFF}


def test_a_controller_that_was_paused_does_not_start_engines_that_have_stopped_meanwhile(
    engines: Engines,
) -> None:
    engines.scheduler.schedule_absolute(5.1, lambda *_: engines.scheduler.sleep(4.0))
    states = engines.states([(1.2, TURN_ON, 1.2)], seen_until(20), 20.0)
    assert {state for time, state in states if 1.3 < time < 5.15} == {ON}
    assert {state for time, state in states if time > 5.15} == {OFF}


def test_nor_one_that_was_paused_shortly_what_has_ended_in_the_pause(engines: Engines) -> None:
    engines.scheduler.schedule_absolute(9.9, lambda *_: engines.scheduler.sleep(2.0))
    states = engines.states([(1.2, TURN_ON, 1.2)], [(1.0, 1.0)], 20.0)
    assert ON in {state for time, state in states if time < 9.95}
    assert {state for time, state in states if time > 9.95} == {OFF}


def test_a_pause_that_the_drive_does_not_notice_changes_nothing(engines: Engines) -> None:
    engines.scheduler.schedule_absolute(5.1, lambda *_: engines.scheduler.sleep(2.0))
    assert engines.run([(1.2, TURN_ON, 1.2)], seen_until(12), 12.0) == [(0.002, OFF), (1.2, ON)]


def test_after_a_restart_they_are_off_though_the_operator_is_there(engines: Engines) -> None:
    assert engines.run([], seen_until(30)) == [(0.002, OFF)]


times = st.floats(0.01, 50.0)
IN_STEP = 0.05  # s


@given(
    st.lists(st.tuples(times, st.sampled_from([TURN_ON, TURN_OFF]), st.floats(-20.0, 1.0)), max_size=8),
    st.lists(st.tuples(times, st.floats(-20.0, 1.0) | st.floats(-0.1, 0.1)), max_size=40),
)
def test_they_are_never_on_without_presence_nor_against_a_command(
    commands: list[tuple[float, str, float]], presences: list[tuple[float, float]]
) -> None:
    arrived = [(at, at + lag) for at, lag in sorted(presences)]
    ordered = [(at, command, at + lag) for at, command, lag in sorted(commands)]

    states = Engines().run(ordered, arrived, until=70.0)

    for (begin, state), (end, _) in zip(states, [*states[1:], (70.0, OFF)], strict=True):
        if state == ON:
            assert any(abs(begin - at) < 1e-6 and command == TURN_ON for at, command, _ in ordered)
            seen = [(at, min(at, stamp)) for at, stamp in arrived if stamp <= at + IN_STEP + 1e-5]
            assert any(at <= begin and begin - 1.0 - 1e-5 <= stamp for at, stamp in seen)
            within = [command for at, command, _ in ordered if begin + 1e-6 < at < end - 1e-6]
            assert TURN_OFF not in within
            lasting = [stamp for at, stamp in seen if at < end]
            assert end - max(lasting) <= 10.0 + 1e-5
    assert states[0][1] == OFF
