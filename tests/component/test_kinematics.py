from __future__ import annotations

import cmath
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.robot_model import forward_kinematics
from services.kinematics import effector_position

on_next, on_completed, subscribe = ReactiveTest.on_next, ReactiveTest.on_completed, ReactiveTest.subscribe

lengths = st.floats(0, 1e300)
angles = st.floats(-1e15, 1e15)


def test_every_change_emits_once_all_four_parameters_are_known(scheduler: TestScheduler) -> None:
    l1 = scheduler.create_hot_observable(on_next(210, 2.0), on_next(250, 1.0))
    l2 = scheduler.create_hot_observable(on_next(220, 3.0))
    theta1 = scheduler.create_hot_observable(on_next(205, 9.0), on_next(230, 0.0))
    theta2 = scheduler.create_hot_observable(on_next(240, 0.0), on_next(260, 0.0))

    results = scheduler.start(lambda: effector_position(l1, l2, theta1, theta2))

    assert results.messages == [on_next(240, (5.0, 0.0)), on_next(250, (4.0, 0.0)), on_next(260, (4.0, 0.0))]
    for source in (l1, l2, theta1, theta2):
        assert source.subscriptions == [subscribe(200, 1000)]


def test_position_completes_when_all_parameters_do(scheduler: TestScheduler) -> None:
    sources = [scheduler.create_hot_observable(on_completed(time)) for time in (210, 240, 220, 230)]

    results = scheduler.start(lambda: effector_position(*sources))

    assert results.messages == [on_completed(240)]
    assert [source.subscriptions for source in sources] == [
        [subscribe(200, time)] for time in (210, 240, 220, 230)
    ]


@given(lengths, lengths, angles, angles)
def test_position_equals_complex_arithmetic(l1: float, l2: float, theta1: float, theta2: float) -> None:
    expected = l1 * cmath.exp(1j * theta1) + l2 * cmath.exp(1j * (theta1 + theta2))

    x, y = forward_kinematics(l1, l2, theta1, theta2)

    assert complex(x, y) == pytest.approx(expected, rel=1e-9, abs=1e-9 * (l1 + l2))


@given(*[st.floats(allow_nan=False, allow_infinity=False)] * 4)
def test_finite_parameters_never_raise(l1: float, l2: float, theta1: float, theta2: float) -> None:
    forward_kinematics(l1, l2, theta1, theta2)


def test_infinite_sum_of_angles_gives_nan() -> None:
    assert all(map(math.isnan, forward_kinematics(1.0, 1.0, 1.7e308, 1.7e308)))
