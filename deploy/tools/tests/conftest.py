"""
Fixtures for the tests of the tools: plain nodes.

The tests pass on ROS 2's own tools as well, except for those marked `own`: they need what ROS 2 does
differently (its daemon, tracebacks) or what its installation may lack.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node


def pytest_configure(config: pytest.Config) -> None:
    """Register the mark `own`."""
    config.addinivalue_line("markers", "own: needs the tools of this distribution")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests marked `own` if an installed ROS 2 brings its own tools."""
    if importlib.util.find_spec("ros2cli.commands"):  # ROS 2's ros2cli has no such module
        return
    for item in items:
        if item.get_closest_marker("own"):
            item.add_marker(pytest.mark.skip(reason="platform: ROS 2 has its own tools"))


@pytest.fixture
def executor(context: Context) -> Iterator[SingleThreadedExecutor]:
    """The executor that rclpy documents, in the test's context."""
    with SingleThreadedExecutor(context=context) as executor:
        yield executor


@pytest.fixture
def make_node(context: Context) -> Iterator[Callable[..., Node]]:
    """Makes nodes in the test's context and destroys them after the test; no executor spins them."""
    with ExitStack() as stack:

        def make(name: str = "node", **options: Any) -> Node:
            node = Node(name, **{"context": context, **options})
            stack.callback(node.destroy_node)
            return node

        yield make


@pytest.fixture
def node(make_node: Callable[..., Node], executor: SingleThreadedExecutor) -> Node:
    """A node in the test's executor."""
    node = make_node()
    executor.add_node(node)
    return node


@pytest.fixture
def other_context(domain_id: int) -> Iterator[Context]:
    """A second participant in the test's domain, as another process would be."""
    context = Context()
    context.init([], domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()
