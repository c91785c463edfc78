"""The action that the tests use. ROS 2's wheels have it in another package."""

from __future__ import annotations

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:
    from test_msgs.action import Fibonacci

__all__ = ["PACKAGE", "Fibonacci"]

PACKAGE = Fibonacci.__module__.partition(".")[0]
