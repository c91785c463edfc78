"""Fixtures for the tests of rclpy: plain nodes, which no executor spins unless the test says so."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from rclpy.clock import ROSClock
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time
from rclpy.time_source import TimeSource


@pytest.fixture
def make_node(context: Context) -> Iterator[Callable[..., Node]]:
    """Makes nodes of the test's context and ends them with the test."""
    with ExitStack() as stack:

        def make(name: str = "node", **options: Any) -> Node:
            node = Node(name, **{"context": context, **options})
            stack.callback(node.destroy_node)
            return node

        yield make


@pytest.fixture
def node(make_node: Callable[..., Node], executor: SingleThreadedExecutor) -> Node:
    """A node that the test's executor spins."""
    node = make_node()
    executor.add_node(node)
    return node


@pytest.fixture
def clock() -> ROSClock:
    """ROS time that stands still, 1 µs after its epoch, unless the test moves it."""
    clock, simulator = ROSClock(), TimeSource()
    simulator.ros_time_is_active = True
    simulator.attach_clock(clock)
    clock.set_ros_time_override(Time(nanoseconds=1000, clock_type=clock.clock_type))
    return clock
