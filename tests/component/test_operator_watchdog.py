from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, NamedTuple

import reactivex as rx
from hypothesis import given
from hypothesis import strategies as st
from reactivex import Observable
from reactivex.subject import Subject
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.activity import Activity
from interfaces.topics import ALIVE, INCAPACITATED, MISSED, TURN_OFF
from reactive_node.stamps import Timestamp
from services.operator_watchdog import Parameters, engine_commands, operator_activity

on_next, on_completed, subscribe = ReactiveTest.on_next, ReactiveTest.on_completed, ReactiveTest.subscribe

BEGIN = 0.010  # when the thesis' application subscribes [s]


class Watch(NamedTuple):
    """When the watchdog concludes what, and when it commands `turn_off` [s]."""

    alive: list[float]
    missed: list[float]
    incapacitated: list[float]
    turn_off: list[float]


def watch(scheduler: TestScheduler, heartbeats: Any, until: float, **options: Any) -> Watch:
    def everything(activity: Observable[Activity]) -> Observable[str]:
        return rx.merge(activity.map(lambda it: it.conclusion), engine_commands(activity))

    results = scheduler.start(
        lambda: operator_activity(heartbeats, **options).publish(everything),
        created=BEGIN / 2,
        subscribed=BEGIN,
        disposed=until,
    )
    emitted = [(message.value.value, message.time) for message in results.messages]
    times = {kind: [at for what, at in emitted if what == kind] for kind, _ in emitted}
    return Watch(*(times.get(kind, []) for kind in (ALIVE, MISSED, INCAPACITATED, TURN_OFF)))


def heartbeat(time: float) -> Timestamp[bool]:
    return Timestamp(True, datetime.fromtimestamp(time, UTC))


def hot(scheduler: TestScheduler, *times: float) -> Any:
    return scheduler.create_hot_observable(*(on_next(time, heartbeat(time)) for time in times))


def test_three_silences_turn_off_as_in_the_listing(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, 1.942, 1.991, 2.041, 2.091, 2.141, 2.192, 2.242, 2.292, 2.342, 2.392, 4.444)

    watched = watch(scheduler, heartbeats, 14.6)

    assert watched.alive == [2.01, 2.51, 4.51]
    assert watched.missed == [7.51, 10.51, 13.51]
    assert watched.incapacitated == [13.51]
    assert watched.turn_off == [13.51, 14.01, 14.51]
    assert heartbeats.subscriptions == [subscribe(BEGIN, 14.6)]


def test_alive_has_the_source_time_of_the_sampled_heartbeat(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, 0.1, 0.4)

    results = scheduler.start(
        lambda: operator_activity(heartbeats), created=BEGIN / 2, subscribed=BEGIN, disposed=1.0
    )

    assert results.messages == [on_next(0.51, Activity(ALIVE, heartbeat(0.4).timestamp))]


def test_strikes_do_not_reset_when_the_operator_returns(scheduler: TestScheduler) -> None:
    watched = watch(scheduler, hot(scheduler, 4.0, 8.0), 11.6)

    assert watched.missed == [3.01, 7.01, 11.01]
    assert watched.alive == [4.01, 8.01]
    assert watched.turn_off == [11.01, 11.51]


def test_return_at_the_third_strike_is_too_late(scheduler: TestScheduler) -> None:
    heartbeats: Subject[Timestamp[bool]] = Subject()

    def beat_in_every_step(_: Any, steps: int) -> None:
        heartbeats.on_next(heartbeat(scheduler.clock))
        if steps:
            scheduler.schedule(beat_in_every_step, steps - 1)

    scheduler.schedule_absolute(9.01, beat_in_every_step, 50)

    watched = watch(scheduler, heartbeats, 9.4)

    assert watched.incapacitated == [9.01]
    assert watched.turn_off == [9.01]
    assert watched.alive == [9.01]


def test_return_is_alive_at_once_and_begins_new_strikes(scheduler: TestScheduler) -> None:
    watched = watch(scheduler, hot(scheduler, 10.2), 19.4)

    assert watched.missed == [3.01, 6.01, 9.01, 13.2, 16.2, 19.2]
    assert watched.alive == [10.2]
    assert watched.incapacitated == [9.01, 19.2]
    assert watched.turn_off == [9.01, 9.51, 10.01, 19.2]


def test_flood_of_heartbeats_is_alive_twice_a_second(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, *(0.011 + step / 1000 for step in range(5000)))

    watched = watch(scheduler, heartbeats, 5.4)

    assert watched.alive == [0.51, 1.01, 1.51, 2.01, 2.51, 3.01, 3.51, 4.01, 4.51, 5.01]
    assert watched[1:] == ([], [], [])


def test_heartbeats_at_the_moments_of_the_samples_count(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, *(BEGIN + step / 2 for step in range(1, 40)))

    watched = watch(scheduler, heartbeats, 19.4)

    assert len(watched.alive) == 38
    assert watched[1:] == ([], [], [])


def test_end_of_the_heartbeats_is_a_silence(scheduler: TestScheduler) -> None:
    heartbeats = scheduler.create_hot_observable(on_next(1.0, heartbeat(1.0)), on_completed(2.0))

    watched = watch(scheduler, heartbeats, 30.0)

    assert 10.0 <= watched.turn_off[0] <= 10.5


def strikes(heartbeats: list[int], until: int) -> list[int]:
    """Return when the operator is missed [ms], by a model without Rx: each sample looks for heartbeats."""
    missed: list[int] = []
    begin = seen = 10
    pending = sorted(heartbeats)
    while len(missed) < 3:
        before = begin
        for sample in range(begin + 500, until, 500):
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


@given(st.lists(st.integers(11, 20_000), max_size=30))
def test_watchdog_fires_if_and_only_if_there_were_three_silences(heartbeats: list[int]) -> None:
    until = 25_000
    expected = strikes(heartbeats, until)
    scheduler = TestScheduler()
    times = [time / 1000 for time in sorted(heartbeats)]

    watched = watch(scheduler, hot(scheduler, *times), until / 1000)

    assert [round(time * 1000) for time in watched.missed[:3]] == expected
    first = [round(time * 1000) for time in watched.turn_off[:1]]
    assert first == expected[2:]
    assert first == [round(time * 1000) for time in watched.incapacitated[:1]]


def test_watchdog_that_resumes_reports_the_first_heartbeat_at_once(scheduler: TestScheduler) -> None:
    heartbeats = hot(scheduler, 0.3, 0.35, 0.7, 0.75, 1.4)

    watched = watch(scheduler, heartbeats, 11.0, resumes=True)

    assert watched.alive == [0.3, 0.8, 1.8]
    assert [round(time, 3) for time in watched.missed] == [4.8, 7.8, 10.8]
    assert [round(time, 3) for time in watched.incapacitated] == [10.8]


def test_successor_waits_for_its_first_heartbeat_before_a_strike(scheduler: TestScheduler) -> None:
    quick = Parameters(sampling=0.05, silence=0.25, strikes=1)

    watched = watch(scheduler, hot(scheduler, 0.9), 2.0, parameters=quick, resumes=True)

    assert watched.alive == [0.9]
    assert [round(time, 3) for time in watched.missed] == [1.15]


def test_successor_that_hears_nothing_begins_to_count(scheduler: TestScheduler) -> None:
    watched = watch(scheduler, hot(scheduler), 11.0, resumes=True)

    assert [round(time, 3) for time in watched.missed] == [4.01, 7.01, 10.01]
    assert [round(time, 3) for time in watched.incapacitated] == [10.01]


@given(st.integers(1, 50), st.integers(10, 100))
def test_a_lost_heartbeat_is_no_strike_if_silence_is_sampling_and_two_periods(
    begin: int, sampling: int
) -> None:
    shortest = Parameters(sampling=sampling / 1000, silence=(sampling + 2 * 50) / 1000, strikes=1)
    times = [(begin + 50 * beat) / 1000 for beat in range(40) if beat % 4]  # each fourth one is lost
    scheduler = TestScheduler()

    watched = watch(scheduler, hot(scheduler, *times), times[-1], parameters=shortest, resumes=True)

    assert watched[1:] == ([], [], [])


def test_turn_off_repeats_until_the_operator_is_alive(scheduler: TestScheduler) -> None:
    conclusions = [(300, ALIVE), (310, MISSED), (320, INCAPACITATED), (345, ALIVE), (400, INCAPACITATED)]
    activity = scheduler.create_hot_observable(*(on_next(at, Activity(what)) for at, what in conclusions))

    results = scheduler.start(lambda: engine_commands(activity, repeat=10), disposed=425)

    assert results.messages == [on_next(at, TURN_OFF) for at in (320, 330, 340, 400, 410, 420)]
    assert activity.subscriptions == [subscribe(200, 425)]


def test_turn_off_is_sent_though_the_operator_returns_at_once(scheduler: TestScheduler) -> None:
    activity = scheduler.create_hot_observable(
        on_next(300, Activity(INCAPACITATED)), on_next(300, Activity(ALIVE))
    )

    results = scheduler.start(lambda: engine_commands(activity))

    assert results.messages == [on_next(300, TURN_OFF)]
