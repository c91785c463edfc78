"""Timers whose clock changes its source."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import ROSClock
from rclpy.node import Node

from tests.conformance.test_timers import simulated

MakeNode = Callable[..., Node]


def test_when_simulated_time_begins_what_remained_of_a_period_remains(make_node: MakeNode) -> None:
    clock = ROSClock()
    timer = make_node().create_timer(3600.0, lambda: None, clock=clock)
    clock.set_ros_time_override(simulated(7))
    clock._set_ros_time_is_active(True)
    remaining = timer.time_until_next_call()
    assert remaining is not None
    assert 3_590_000_000_000 < remaining <= 3_600_000_000_000
