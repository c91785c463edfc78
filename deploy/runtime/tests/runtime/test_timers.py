"""Timers whose clock changes its source, and how a rate sleeps."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from deploy.runtime.tests.conformance.test_timers import simulated

from rclpy.clock import ROSClock
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

MakeNode = Callable[..., Node]


def test_when_simulated_time_begins_what_remained_of_a_period_remains(make_node: MakeNode) -> None:
    clock = ROSClock()
    timer = make_node().create_timer(3600.0, lambda: None, clock=clock)
    clock.set_ros_time_override(simulated(7))
    clock._set_ros_time_is_active(True)
    remaining = timer.time_until_next_call()
    assert remaining is not None
    assert 3_590_000_000_000 < remaining <= 3_600_000_000_000


def test_a_simulated_time_that_was_never_heard_changes_nothing_for_a_timer(make_node: MakeNode) -> None:
    clock = ROSClock()
    timer = make_node().create_timer(3600.0, lambda: None, clock=clock)
    clock._set_ros_time_is_active(True)
    clock._set_ros_time_is_active(False)
    remaining = timer.time_until_next_call()
    assert remaining is not None
    assert 3_590_000_000_000 < remaining <= 3_600_000_000_000


def test_a_tick_that_came_while_nobody_slept_lets_the_next_sleeper_go_at_once(
    clock: ROSClock, executor: SingleThreadedExecutor, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    rate = node.create_rate(1e6, clock)
    waits: list[bool] = []
    monkeypatch.setattr(rate._ticks, "wait_for", lambda woken: waits.append(woken()))
    clock.set_ros_time_override(simulated(2000))
    executor.spin_once(timeout_sec=0)
    rate.sleep()
    assert waits == []
    rate.sleep()
    assert waits == [False]


def test_a_tick_that_woke_its_sleeper_does_not_let_him_go_again(
    clock: ROSClock, executor: SingleThreadedExecutor, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    rate = node.create_rate(1e6, clock)
    waits: list[bool] = []

    def tick(woken: Callable[[], bool]) -> None:
        if len(waits) < 2:
            clock.set_ros_time_override(simulated(2000 + 1000 * len(waits)))
            executor.spin_once(timeout_sec=0)
        waits.append(woken())

    monkeypatch.setattr(rate._ticks, "wait_for", tick)
    for _ in range(3):
        rate.sleep()
    assert waits == [True, True, False]
