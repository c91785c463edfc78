"""The recipe of the operator's activity (thesis 5.2.3)."""

from __future__ import annotations

import itertools
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from reactivex.subject import Subject
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.topics import TURN_OFF
from services.operator_watchdog import operator_activity, operator_incapacitated

on_next, on_completed, subscribe = ReactiveTest.on_next, ReactiveTest.on_completed, ReactiveTest.subscribe

BEGIN = 0.010  # when the thesis' application subscribes [s]


def watch(
    scheduler: TestScheduler, heartbeats: Any, until: float, **options: Any
) -> tuple[list[tuple[float, str]], list[float], list[float]]:
    """Return what the watchdog commands, and when the operator is alive and missed."""
    alive: list[float] = []
    missed: list[float] = []
    results = scheduler.start(
        lambda: operator_incapacitated(
            heartbeats,
            alive=lambda _: alive.append(scheduler.clock),
            missed=lambda _: missed.append(scheduler.clock),
            **options,
        ),
        created=BEGIN / 2,
        subscribed=BEGIN,
        disposed=until,
    )
    return [(message.time, message.value.value) for message in results.messages], alive, missed


def hot(scheduler: TestScheduler, *times: float) -> Any:
    return scheduler.create_hot_observable(*(on_next(time, time) for time in times))


def test_three_silences_of_three_seconds_turn_the_engines_off_as_in_the_listing(
    scheduler: TestScheduler,
) -> None:
    heartbeats = hot(scheduler, 1.942, 1.991, 2.041, 2.091, 2.141, 2.192, 2.242, 2.292, 2.342, 2.392, 4.444)

    commands, alive, missed = watch(scheduler, heartbeats, 14.6)

    assert alive == [2.01, 2.51, 4.51]
    assert missed == [7.51, 10.51, 13.51]
    assert commands == [(13.51, TURN_OFF), (14.01, TURN_OFF), (14.51, TURN_OFF)]
    assert heartbeats.subscriptions == [subscribe(BEGIN, 14.6)]


def test_the_recipe_of_the_thesis_is_three_subscriptions_in_all(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, 1.0)

    results = scheduler.start(
        lambda: operator_activity(heartbeats), created=0.005, subscribed=BEGIN, disposed=99.0
    )

    assert [(message.time, message.value.kind) for message in results.messages] == [(10.01, "E")]
    assert heartbeats.subscriptions == [subscribe(0.01, 4.01), subscribe(4.01, 7.01), subscribe(7.01, 10.01)]


def test_strikes_do_not_reset_when_the_operator_comes_back_in_between(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, 4.0, 8.0)

    commands, alive, missed = watch(scheduler, heartbeats, 11.6)

    assert missed == [3.01, 7.01, 11.01]
    assert alive == [4.01, 8.01]
    assert commands == [(11.01, TURN_OFF), (11.51, TURN_OFF)]


def test_who_comes_back_in_the_moment_of_the_third_strike_prevents_nothing(scheduler: TestScheduler) -> None:
    heartbeats: Subject[float] = Subject()
    silences = itertools.count(1)

    def missed(_: Exception) -> None:
        if next(silences) == 3:  # `retry` ends a step later: between that and what follows it
            scheduler.schedule(lambda *_: scheduler.schedule(lambda *_: heartbeats.on_next(0.0)))

    results = scheduler.start(
        lambda: operator_incapacitated(heartbeats, missed=missed),
        created=BEGIN / 2,
        subscribed=BEGIN,
        disposed=12.0,
    )

    assert [message.value.value for message in results.messages[:1]] == [TURN_OFF]


def test_a_return_is_seen_at_once_and_begins_three_new_strikes(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, 10.2)

    commands, alive, missed = watch(scheduler, heartbeats, 19.4)

    assert missed == [3.01, 6.01, 9.01, 13.2, 16.2, 19.2]
    assert alive == [10.2]
    assert commands == [(9.01, TURN_OFF), (9.51, TURN_OFF), (10.01, TURN_OFF), (19.2, TURN_OFF)]


def test_however_many_heartbeats_come_the_operator_is_alive_twice_a_second(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, *(0.011 + step / 1000 for step in range(5000)))

    commands, alive, missed = watch(scheduler, heartbeats, 5.4)

    assert alive == [0.51, 1.01, 1.51, 2.01, 2.51, 3.01, 3.51, 4.01, 4.51, 5.01]
    assert (commands, missed) == ([], [])


def test_heartbeats_that_only_just_come_with_the_samples_are_signs_of_life(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, *(BEGIN + step / 2 for step in range(1, 40)))

    commands, alive, missed = watch(scheduler, heartbeats, 19.4)

    assert len(alive) == 38
    assert (commands, missed) == ([], [])


def test_a_silence_of_almost_three_seconds_is_none(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, *(0.1 + step * 2.4 for step in range(40)))

    commands, _, missed = watch(scheduler, heartbeats, 90.0)

    assert (commands, missed) == ([], [])


def test_the_end_of_the_heartbeats_is_a_silence(scheduler: TestScheduler) -> None:
    heartbeats = scheduler.create_hot_observable(on_next(1.0, 1.0), on_completed(2.0))

    commands, _, _ = watch(scheduler, heartbeats, 30.0)

    assert {command for _, command in commands} == {TURN_OFF}
    assert 10.0 <= commands[0][0] <= 10.5


def strikes(heartbeats: list[int], first: int, until: int) -> list[int]:
    """
    Return when the operator is missed, in ms, by a model that knows no Rx.

    A silence is one of the samples: of each half second, from the first sample on after where counting
    began, whether there was a heartbeat in it.
    """
    missed: list[int] = []
    begin = seen = 10
    pending = sorted(heartbeats)
    while len(missed) < 3:
        before = begin
        for sample in range(begin + first, until, 500):
            if seen + 3000 <= sample:
                break
            beats = [beat for beat in pending if beat <= sample]
            pending = pending[len(beats) :]
            if any(beat > before for beat in beats):
                seen = sample
            before = sample
        if seen + 3000 >= until:
            break
        begin = seen = seen + 3000
        missed.append(begin)
        pending = [beat for beat in pending if beat > begin]
    return missed


@given(st.lists(st.integers(11, 20_000), max_size=30), st.sampled_from([100, 500]))
def test_the_watchdog_fires_if_and_only_if_there_were_three_silences(
    heartbeats: list[int], sample: int
) -> None:
    until = 25_000
    expected = strikes(heartbeats, sample, until)
    scheduler = TestScheduler()
    times = [time / 1000 for time in sorted(heartbeats)]

    commands, _, missed = watch(scheduler, hot(scheduler, *times), until / 1000, first=sample / 1000)

    assert [round(time * 1000) for time in missed[:3]] == expected
    first = round(commands[0][0] * 1000) if commands else None
    assert first == (expected[2] if len(expected) == 3 else None)


@given(st.lists(st.integers(1, 2499), min_size=1, max_size=20))
def test_it_does_not_fire_while_no_gap_is_a_silence(gaps: list[int]) -> None:
    times = [10.0]
    for gap in gaps:
        times.append(times[-1] + gap)
    scheduler = TestScheduler()

    commands, _, missed = watch(scheduler, hot(scheduler, *(time / 1000 for time in times)), times[-1] / 1000)

    assert (commands, missed) == ([], [])


@given(st.lists(st.integers(3500, 6000), min_size=3, max_size=3))
def test_three_gaps_that_each_hold_a_silence_turn_the_engines_off(gaps: list[int]) -> None:
    times = [500.0]
    for gap in gaps:
        times.append(times[-1] + gap)
    scheduler = TestScheduler()

    commands, _, _ = watch(
        scheduler, hot(scheduler, *(time / 1000 for time in times)), times[-1] / 1000 + 0.001
    )

    assert commands
    assert commands[0][1] == TURN_OFF
