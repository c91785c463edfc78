from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reactivex import Subject
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.service import Rejected
from interfaces.topics import EFFECTOR_POSITION, Position
from services.velocity import effector_speed

on_next, on_error, subscribe = ReactiveTest.on_next, ReactiveTest.on_error, ReactiveTest.subscribe

SECOND = 10**9


def test_speed_is_distance_over_time_between_the_stamps(scheduler: TestScheduler) -> None:
    positions = scheduler.create_hot_observable(
        on_next(210, Position(1 * SECOND, 0.0, 0.0)),
        on_next(900, Position(2 * SECOND, 3.0, 4.0)),
        on_next(901, Position(4 * SECOND, 3.0, 5.0)),
    )

    results = scheduler.start(lambda: effector_speed(positions))

    assert results.messages == [on_next(900, 5.0), on_next(901, 0.5)]
    assert positions.subscriptions == [subscribe(200, 1000)]


def test_speed_equal_to_the_one_before_is_omitted(scheduler: TestScheduler) -> None:
    positions = scheduler.create_hot_observable(
        *(
            on_next(200 + time, Position(time * SECOND, x, 0.0))
            for time, x in [(10, 0), (20, 0), (30, 0), (40, 5)]
        )
    )

    results = scheduler.start(lambda: effector_speed(positions))

    assert results.messages == [on_next(220, 0.0), on_next(240, 0.5)]


def test_pair_without_advancing_time_is_rejected(scheduler: TestScheduler) -> None:
    positions = scheduler.create_hot_observable(
        on_next(210, Position(5 * SECOND, 0.0, 0.0)),
        on_next(220, Position(5 * SECOND, 1.0, 0.0)),
        on_next(230, Position(3 * SECOND, 2.0, 0.0)),
        on_next(240, Position(4 * SECOND, 4.0, 0.0)),
    )

    results = scheduler.start(lambda: effector_speed(positions))

    *rejections, last = results.messages
    assert last == on_next(240, 2.0)
    assert [(it.time, it.value.value.topic, it.value.value.reason) for it in rejections] == [
        (220, EFFECTOR_POSITION, "its time stands still"),
        (230, EFFECTOR_POSITION, "its time goes back by 2 s"),
    ]


def test_each_rejection_is_emitted(scheduler: TestScheduler) -> None:
    positions = scheduler.create_hot_observable(
        *(on_next(time, Position(SECOND, 0.0, 0.0)) for time in (210, 220, 230, 240))
    )

    assert len(scheduler.start(lambda: effector_speed(positions)).messages) == 3


def test_error_is_passed_on(scheduler: TestScheduler) -> None:
    error = ValueError("planted")
    positions = scheduler.create_hot_observable(on_error(210, error))

    assert scheduler.start(lambda: effector_speed(positions)).messages == [on_error(210, error)]


coordinates = st.floats(-1e6, 1e6)


@given(st.lists(st.builds(Position, st.integers(0, 2**62), coordinates, coordinates)))
def test_speed_is_finite_and_not_negative_for_all_stamps(positions: list[Position]) -> None:
    speeds: list[float | Rejected] = []
    source: Subject[Position] = Subject()
    effector_speed(source).subscribe(speeds.append)
    for position in positions:
        source.on_next(position)

    assert all(isinstance(speed, Rejected) or (math.isfinite(speed) and speed >= 0) for speed in speeds)


@given(st.integers(0, 2**62), st.integers(1, 10**12), coordinates, coordinates)
def test_straight_movement_has_its_speed(begin: int, nanoseconds: int, x: float, y: float) -> None:
    speeds: list[float | Rejected] = []
    source: Subject[Position] = Subject()
    effector_speed(source).subscribe(speeds.append)
    source.on_next(Position(begin, 0.0, 0.0))
    source.on_next(Position(begin + nanoseconds, x, y))

    assert speeds == [pytest.approx(abs(complex(x, y)) / nanoseconds * 1e9)]
