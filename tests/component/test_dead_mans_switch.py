"""The recipes of the virtual operator."""

from __future__ import annotations

from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.topics import OFF, ON, TURN_OFF, TURN_ON
from services.dead_mans_switch import engine_commands, heartbeats

on_next, subscribe = ReactiveTest.on_next, ReactiveTest.subscribe


def test_switch_beats_at_its_rate_while_it_is_pressed(
    scheduler: TestScheduler,
) -> None:
    pressed = scheduler.create_hot_observable(on_next(300, True), on_next(345, False), on_next(800, True))
    rate = scheduler.create_hot_observable(on_next(210, 0.1), on_next(830, 0.02))
    single = scheduler.create_hot_observable(on_next(500, True), on_next(805, True))

    results = scheduler.start(lambda: heartbeats(pressed, rate, single))

    times = [310, 320, 330, 340, 500, 805, 810, 820, 880, 930, 980]
    assert results.messages == [on_next(time, True) for time in times]
    assert [source.subscriptions for source in (pressed, rate, single)] == [[subscribe(200, 1000)]] * 3


def test_command_is_repeated_until_the_engines_obey(scheduler: TestScheduler) -> None:
    commands = scheduler.create_hot_observable(on_next(210, TURN_ON), on_next(300, TURN_OFF))
    states = scheduler.create_hot_observable(
        *(on_next(time, state) for time, state in [(215, OFF), (242, ON), (250, ON), (305, OFF)])
    )

    results = scheduler.start(lambda: engine_commands(commands, states, period=10))

    assert results.messages == [
        *(on_next(time, TURN_ON) for time in (210, 220, 230, 240)),
        on_next(300, TURN_OFF),
    ]
    assert states.subscriptions == [subscribe(210, 242), subscribe(300, 305)]


def test_command_is_repeated_a_limited_number_of_times(scheduler: TestScheduler) -> None:
    commands = scheduler.create_hot_observable(on_next(210, TURN_ON))
    states = scheduler.create_hot_observable(on_next(215, OFF))

    results = scheduler.start(lambda: engine_commands(commands, states, period=10, times=3))

    assert results.messages == [on_next(time, TURN_ON) for time in (210, 220, 230)]
