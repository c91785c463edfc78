"""Timers whose clock switches to simulated time, and the sleep of rates."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rclpy.clock import ClockType, ROSClock
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time


def ros_time(nanoseconds: int) -> Time:
    return Time(nanoseconds=nanoseconds, clock_type=ClockType.ROS_TIME)


@pytest.mark.parametrize("arrives", [True, False])
def test_a_switch_to_simulated_time_keeps_the_remaining_period(make_node: MakeNode, arrives: bool) -> None:
    clock = ROSClock()
    timer = make_node().create_timer(3600.0, lambda: None, clock=clock)
    if arrives:
        clock.set_ros_time_override(ros_time(7))
    clock._set_ros_time_is_active(True)
    clock._set_ros_time_is_active(arrives)
    remaining = timer.time_until_next_call()
    assert remaining is not None
    assert 3_590_000_000_000 < remaining <= 3_600_000_000_000


def test_a_tick_before_a_sleep_ends_the_sleep_at_once(
    clock: ROSClock, executor: SingleThreadedExecutor, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    rate = node.create_rate(1e6, clock)
    waits: list[bool] = []
    monkeypatch.setattr(rate._rclpy_ticks, "wait_for", lambda woken: waits.append(woken()))
    clock.set_ros_time_override(ros_time(2000))
    executor.spin_once(timeout_sec=0)
    rate.sleep()
    assert waits == []
    rate.sleep()
    assert waits == [False]


def test_a_tick_ends_only_one_sleep(
    clock: ROSClock, executor: SingleThreadedExecutor, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    rate = node.create_rate(1e6, clock)
    waits: list[bool] = []

    def tick(woken: Callable[[], bool]) -> None:
        if len(waits) < 2:
            clock.set_ros_time_override(ros_time(2000 + 1000 * len(waits)))
            executor.spin_once(timeout_sec=0)
        waits.append(woken())

    monkeypatch.setattr(rate._rclpy_ticks, "wait_for", tick)
    for _ in range(3):
        rate.sleep()
    assert waits == [True, True, False]
