"""Plain callbacks on ROS 2's EventsExecutor."""

from __future__ import annotations

import importlib

from tests.benchmarks.links import callbacks


class Connection(callbacks.Connection):
    """A node on this executor."""

    make_executor = importlib.import_module("rclpy.experimental").EventsExecutor
