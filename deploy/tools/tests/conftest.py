"""Fixtures for the tests of the tools: plain nodes.

The tests pass on ROS 2's own tools as well, except for those marked `own`: they need what ROS 2 does
differently (its daemon, tracebacks) or what its installation may lack.
"""

from __future__ import annotations

import importlib.util

import pytest
from deploy.ground.tests.conftest import call, executor, make_node, node, other_context

__all__ = ["call", "executor", "make_node", "node", "other_context"]


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "own: needs the tools of this distribution")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests marked `own` if an installed ROS 2 brings its own tools."""
    if importlib.util.find_spec("ros2cli.commands"):  # ROS 2's ros2cli has no such module
        return
    for item in items:
        if item.get_closest_marker("own"):
            item.add_marker(pytest.mark.skip(reason="platform: ROS 2 has its own tools"))
