"""Transforms where tf2_msgs is not installed, as with ROS 2's wheels: one clear line."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.own

ERROR = (
    "ModuleNotFoundError: tf2_ros needs the messages of tf2_msgs, which ROS 2's wheels on PyPI do not have:"
    " use an installed ROS 2 or rclpy-cyclonedds, or build tf2_msgs"
)


def imported(name: str) -> subprocess.CompletedProcess[str]:
    program = f"import sys; sys.modules['tf2_msgs'] = None; import {name}"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30)


@pytest.mark.parametrize("name", ["tf2_ros", "tf2_geometry_msgs"])
def test_transforms_without_their_messages_are_one_clear_line(name: str) -> None:
    done = imported(name)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == ERROR
    assert "During handling" not in done.stderr


def test_buffer_core_needs_no_messages_of_tf2() -> None:
    assert imported("tf2_py").returncode == 0
