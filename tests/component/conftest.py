"""Virtual time for recipes, real nodes for the interfaces."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from reactivex.testing import TestScheduler

from interfaces.reactive_node import ReactiveNode


@pytest.fixture
def scheduler() -> TestScheduler:
    """Virtual time [s]."""
    return TestScheduler()


@pytest.fixture
def make_node(context: Context, executor: SingleThreadedExecutor) -> Iterator[Callable[..., Any]]:
    """Makes nodes that the test's executor spins."""
    with ExitStack() as stack:

        def make(name: str, kind: type[Node] = ReactiveNode, **options: Any) -> Node:
            node = kind(name, context=context, **options)
            stack.callback(node.destroy_node)
            executor.add_node(node)
            return node

        yield make


@pytest.fixture
def spin_for(executor: SingleThreadedExecutor) -> Callable[[float], None]:
    """Spins for so many seconds: for what must not happen."""

    def spin(seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)

    return spin
