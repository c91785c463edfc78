"""Nodes and contexts for the tests of the embedded runtime."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:
    """An initialized context that handles no signals, in a domain of its own."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()


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
def executor(context: Context) -> Iterator[SingleThreadedExecutor]:
    """A single-threaded executor of the test's context."""
    with SingleThreadedExecutor(context=context) as executor:
        yield executor


@pytest.fixture
def spin_until(executor: SingleThreadedExecutor) -> Callable[..., None]:
    """Spins the test's executor until a condition is true; fails when that takes too long."""

    def spin(condition: Callable[[], object], seconds: float = 10.0) -> None:
        clock = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)
        deadline = clock.now().nanoseconds + int(seconds * 1e9)
        while not condition():
            assert clock.now().nanoseconds < deadline, f"not within {seconds} s"
            executor.spin_once(timeout_sec=0.1)

    return spin
