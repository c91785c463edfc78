"""Plain callbacks on ROS 2's EventsExecutor."""

from __future__ import annotations

import importlib

from tests.benchmarks.links import callbacks


class Connection(callbacks.Connection):
    """A node on the executor that the embedded rclpy does not have."""

    make_executor = importlib.import_module("rclpy.experimental").EventsExecutor
