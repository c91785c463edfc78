"""Fixtures for tests of nodes: a DDS domain of their own, nodes in it, an executor that spins them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from reactivex.testing import TestScheduler

from reactive_node.domains import reserved_domain
from reactive_node.node import ReactiveNode


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A free ROS_DOMAIN_ID, in the environment too."""
    with reserved_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        yield domain


@pytest.fixture(scope="module")
def module_domain_id() -> Iterator[int]:
    """A free ROS_DOMAIN_ID for what the tests of a module share; the environment stays as it is."""
    with reserved_domain() as domain:
        yield domain


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:
    """An initialized context that handles no signals, in a domain of its own."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()


@pytest.fixture
def executor(context: Context) -> Iterator[SingleThreadedExecutor]:
    """A single-threaded executor of the test's context."""
    with SingleThreadedExecutor(context=context) as executor:
        yield executor


@pytest.fixture
def make_node(context: Context, executor: SingleThreadedExecutor) -> Iterator[Callable[..., Any]]:
    """Makes nodes that the test's executor spins, and ends them with the test."""
    with ExitStack() as stack:

        def make(name: str = "node", kind: type[Node] = ReactiveNode, **options: Any) -> Node:
            node = kind(name, **{"context": context, **options})
            stack.callback(node.destroy_node)
            executor.add_node(node)
            return node

        yield make


@pytest.fixture
def scheduler() -> TestScheduler:
    """Virtual time [s]."""
    return TestScheduler()


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


@pytest.fixture
def spin_for(executor: SingleThreadedExecutor) -> Callable[[float], None]:
    """Spins for so many seconds: for what must not happen."""

    def spin(seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)

    return spin
