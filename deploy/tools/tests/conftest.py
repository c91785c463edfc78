"""Fixtures for the tests of the tools: plain nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node


@pytest.fixture
def make_node(context: Context) -> Iterator[Callable[..., Node]]:
    """Makes nodes in the test's context and destroys them after the test; no executor spins them."""
    with ExitStack() as stack:

        def make(name: str = "node") -> Node:
            node = Node(name, context=context)
            stack.callback(node.destroy_node)
            return node

        yield make


@pytest.fixture
def node(make_node: Callable[..., Node], executor: SingleThreadedExecutor) -> Node:
    """A node in the test's executor."""
    node = make_node()
    executor.add_node(node)
    return node
