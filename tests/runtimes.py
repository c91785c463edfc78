"""Which tests run on which rclpy."""

from __future__ import annotations

import importlib.util

EMBEDDED_ONLY = (
    "deploy/runtime/tests/interop",
    "deploy/runtime/tests/runtime",
    "tests/commands/test_fleet.py",
    "tests/mutants",
    "tests/security/attacks",
    "tests/replay",
    "tests/simulation",
    "tests/simulation_kit",
)
"""Tests of the embedded rclpy, and of what runs only on it."""
EVENTS = ("interfaces/reactive_node/tests/test_events_executor.py",)
"""Tests of an executor that ROS 2 has, but the embedded rclpy has not."""


def left_out_here() -> tuple[str, ...]:
    """Return the files and folders whose tests cannot run on the rclpy of this process."""
    if importlib.util.find_spec("rosidl_runtime_embedded"):
        return EVENTS
    return EMBEDDED_ONLY
