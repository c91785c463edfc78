"""Where a package comes from that a program misses."""

from __future__ import annotations

import sys

_OF_ROS = ("ament_", "launch", "nav2", "ros2", "rosbag2", "rosidl_", "tf2", "turtlesim")
_INTERFACES = ("_interfaces", "_msgs", "_srvs")


def note_origin(error: BaseException) -> None:
    """Let the traceback of an import that has failed end with where the package comes from."""
    if not isinstance(error, ModuleNotFoundError) or getattr(error, "__notes__", None):
        return
    package = (error.name or "").partition(".")[0]
    if not package or package in sys.modules:
        return
    if package.startswith(_OF_ROS) or package.endswith(_INTERFACES):
        error.add_note(
            f"{package} is missing. Of ROS 2, PyPI has rclpy and common_interfaces only: install"
            f" ros-$ROS_DISTRO-{package.replace('_', '-')}, or build it in a workspace, and source that"
        )
    else:
        error.add_note(f"{package} is missing: install it, or source the ROS 2 or workspace that has it")
