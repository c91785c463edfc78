from __future__ import annotations

import math
from itertools import islice, pairwise
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import reactivex as rx
from reactivex import Observable
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.robot_model import forward_kinematics
from interfaces.sources import playback, scenario_file
from interfaces.sources.timeline import Events, Sweep
from interfaces.topics import Position
from services.kinematics import effector_position
from services.velocity import effector_speed

on_next, on_completed, subscribe = ReactiveTest.on_next, ReactiveTest.on_completed, ReactiveTest.subscribe

DEMO = Path(__file__).parents[2] / "deploy" / "scenarios" / "demo.yaml"


def played(scheduler: TestScheduler, observable: Observable[Any]) -> list[tuple[float, Any]]:
    messages = scheduler.start(lambda: observable, disposed=220.0).messages
    return [
        (pytest.approx(message.time - 200, abs=1e-9), message.value.value)
        for message in messages
        if message.value.kind == "N"
    ]


# Events


def test_state_changes_at_the_times_of_its_events(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (1.0, "b"), (1.5, "c"), (1.5, "d")))

    assert played(scheduler, playback.state(events, 0.0)) == [(0, "a"), (1.0, "b"), (1.5, "c"), (1.5, "d")]


def test_restarted_state_begins_with_its_last_value(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (1.0, "b"), (3.0, "c")))

    assert played(scheduler, playback.state(events, 2.0)) == [(0, "b"), (1.0, "c")]


@pytest.mark.parametrize(("resume", "overdue"), [(True, []), (False, [(0, "a"), (0, "b")])])
def test_overdue_events_come_at_once_unless_a_source_resumes(
    scheduler: TestScheduler, resume: bool, overdue: list[tuple[float, str]]
) -> None:
    events = Events(((0.0, "a"), (1.0, "b"), (3.0, "c")))

    assert played(scheduler, playback.events(events, 1.5, resume=resume)) == [*overdue, (1.5, "c")]


def test_event_at_the_origin_is_emitted(scheduler: TestScheduler) -> None:
    assert played(scheduler, playback.events(Events(((0.0, "a"),)), 0.0)) == [(0, "a")]


def test_events_repeat_forever(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (3.0, "b")), repeat=5.0)

    changes = played(scheduler, playback.state(events, 4.0))

    assert changes[:5] == [(0, "b"), (1.0, "a"), (4.0, "b"), (6.0, "a"), (9.0, "b")]
    assert next(events.since(1e9 + 3.5)) == (1e9 + 3.0, "b")


def test_state_holds_its_last_value_into_the_next_round() -> None:
    events = Events(((1.0, "a"), (3.0, "b")), repeat=5.0)

    assert next(events.since(0.5)) == (1.0, "a")
    assert next(events.since(5.5)) == (3.0, "b")


@pytest.mark.parametrize("repeat", [0.7, 11.2, 0.1, 1 / 3])
def test_no_event_of_any_round_is_lost_or_repeated(repeat: float) -> None:
    events = Events(((0.0, "a"), (repeat / 3, "b"), (repeat / 2, "c")), repeat)

    changes = list(islice(events.after(0.0), 300))

    assert [value for _, value in changes] == [*"bca"] * 100
    assert all(next(events.since(time)) == (time, value) for time, value in changes)
    assert all(next(events.after(time)) == after for (time, _), after in pairwise(changes))


def test_held_up_events_are_all_emitted(scheduler: TestScheduler) -> None:
    values: list[str] = []

    def take(value: str) -> None:
        values.append(value)
        scheduler.sleep(1.0)

    events = Events(((0.5, "a"), (0.6, "b"), (0.7, "c")))
    playback.state(events, 0.0).subscribe(take, scheduler=scheduler)
    scheduler.advance_to(9.0)

    assert values == ["a", "b", "c"]


# Sweeps


def test_sweep_is_a_sine() -> None:
    sweep = Sweep(center=1.0, amplitude=0.5, period=8.0)
    ahead = Sweep(center=1.0, amplitude=0.5, period=8.0, phase=math.pi / 2)
    times = [step / 10 for step in range(-100, 200)]

    assert [sweep.at(time) for time in (0, 2, 4, 6)] == pytest.approx([1.0, 1.5, 1.0, 0.5])
    assert [sweep.at(t) for t in times] == pytest.approx([1 + math.sin(math.tau * t / 8) / 2 for t in times])
    assert [ahead.at(t) for t in times] == pytest.approx([sweep.at(t + 2.0) for t in times])


def test_sweep_rests_at_its_ends() -> None:
    sweep = Sweep(center=1.0, amplitude=0.5, period=20.0, rest=6.0)  # moves for 4 s, from -2 to 2

    assert [sweep.at(time) for time in (-2, -1, 0, 1, 2)] == pytest.approx(
        [0.5, 0.6464, 1, 1.3536, 1.5], abs=1e-4
    )
    assert {sweep.at(2.0 + step / 10) for step in range(1, 60)} == {1.5}
    assert [sweep.at(time) for time in (8, 10, 12)] == pytest.approx([1.5, 1.0, 0.5])
    assert {sweep.at(12.0 + step / 10) for step in range(1, 60)} == {0.5}
    assert sweep.at(20.0) == pytest.approx(1.0)


def test_sweep_is_sampled_at_its_rate_and_not_while_it_rests(scheduler: TestScheduler) -> None:
    sweep = Sweep(center=1.0, amplitude=0.5, period=2.0, rate=10.0, rest=0.6)  # moves for 0.4 s

    samples = played(scheduler, playback.state(sweep, 10.0))

    times = [0.0, 0.1, 0.2, 0.9, 1.0, 1.1, 1.2, 1.9, 2.0, 2.1, 2.2]
    assert samples[:11] == [(time, pytest.approx(sweep.at(10.0 + time))) for time in times]


def test_sampled_sweep_reaches_its_ends(scheduler: TestScheduler) -> None:
    sweep = Sweep(center=1.0, amplitude=0.5, period=2.0, rate=10.0, rest=0.57)  # moves for 0.43 s
    ends = [value for _, value in played(scheduler, playback.state(sweep, 10.0)) if abs(value - 1.0) == 0.5]
    assert ends[:4] == [1.5, 0.5, 1.5, 0.5]


def test_sweep_sets_no_timer_while_it_rests(scheduler: TestScheduler) -> None:
    sweep = Sweep(center=1.0, amplitude=0.5, period=20.0, rest=6.0)  # moves for 4 s, from -2 to 2
    playback.state(sweep, 1.9).subscribe(scheduler=scheduler)
    scheduler.advance_to(1.0)

    with mock.patch.object(scheduler, "invoke_action", side_effect=scheduler.invoke_action) as invoked:
        scheduler.advance_to(6.0)
        assert invoked.call_count == 0
        scheduler.advance_to(7.1)
        assert 20 < invoked.call_count < 50


def test_held_up_sweep_skips_samples_and_stays_true(scheduler: TestScheduler) -> None:
    sweep = Sweep(0.0, 1.0, 8.0, rate=10.0)
    samples: list[tuple[float, float]] = []

    def take(value: float) -> None:
        samples.append((scheduler.clock, value))
        if len(samples) == 3:
            scheduler.sleep(1.03)

    playback.state(sweep, 0.0).subscribe(take, scheduler=scheduler)
    scheduler.advance_to(2.0)

    assert [time for time, _ in samples[:5]] == pytest.approx([0.0, 0.1, 0.2, 1.23, 1.33])
    assert [value for _, value in samples] == pytest.approx([sweep.at(time) for time, _ in samples])


@pytest.mark.parametrize("offset", [0.0, 0.001, 0.01, 0.02, 0.039])
def test_demo_has_no_speed_above_its_true_maximum(scheduler: TestScheduler, offset: float) -> None:
    joints = scenario_file.load(DEMO).configuration
    theta1, theta2 = joints["theta1"], joints["theta2"]
    assert isinstance(theta1, Sweep)
    assert isinstance(theta2, Sweep)
    path = [forward_kinematics(2.0, 3.0, theta1.at(ms / 1000), theta2.at(ms / 1000)) for ms in range(20_000)]
    fastest = 1000 * max(math.dist(*pair) for pair in pairwise(path))
    positions = effector_position(
        rx.just(2.0),
        rx.just(3.0),
        playback.state(theta1, 0.0),
        rx.timer(offset).flat_map(lambda _: playback.state(theta2, offset)),
    )
    speeds: list[float] = []

    effector_speed(
        positions.map(lambda position: Position(round(scheduler.clock * 1e9), *position))
    ).subscribe(speeds.append, scheduler=scheduler)
    scheduler.advance_to(20.0)

    assert 0.99 * fastest < max(speeds) <= fastest


# Driven


@pytest.mark.parametrize(
    "timeline", [Events(((1.0, "a"), (2.0, "b"))), Events(((1.0, "a"), (2.0, "b")), 5.0)]
)
def test_driven_joint_moves_with_its_time_and_reports_where_it_stands(
    scheduler: TestScheduler, timeline: Events[str]
) -> None:
    times = scheduler.create_hot_observable(
        *(on_next(201.0 + n, time) for n, time in enumerate([0.5, 1.5, 1.5, 1.6, 2.0, 2.0]))
    )

    values = played(scheduler, playback.driven(timeline, times))

    assert values == [(2.0, "a"), (3.0, "a"), (5.0, "b"), (6.0, "b")]


# What a source follows


def test_source_without_a_timeline_follows_its_parameter(scheduler: TestScheduler) -> None:
    parameter = rx.merge(rx.just(1.0), scheduler.create_hot_observable(on_next(300, 2.0)))

    results = scheduler.start(lambda: playback.follow(parameter, None))

    assert results.messages == [on_next(200, 1.0), on_next(300, 2.0)]


def test_source_follows_its_timeline_until_its_parameter_is_set(scheduler: TestScheduler) -> None:
    parameter = rx.merge(rx.just(1.0), scheduler.create_hot_observable(on_next(300, 2.0)))
    timeline = scheduler.create_hot_observable(on_next(250, 7.0), on_next(350, 8.0), on_completed(360))

    results = scheduler.start(lambda: playback.follow(parameter, timeline))

    assert results.messages == [on_next(250, 7.0), on_next(300, 2.0)]
    assert timeline.subscriptions == [subscribe(200, 300)]
