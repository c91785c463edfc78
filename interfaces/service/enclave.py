"""The enclave with which a process joins where ROS 2's ROS_SECURITY_ENABLE asks for security (SROS2)."""

from __future__ import annotations

import os

ENABLE = "ROS_SECURITY_ENABLE"
"""Environment variable: ROS 2 secures DDS if it is ``true``."""


def path(name: str, namespace: str) -> str:
    """Return the enclave of a name in the namespace of an arm, for example ``/arm1/kinematics``."""
    return f"{namespace.rstrip('/')}/{name}"


def arguments(name: str, namespace: str) -> list[str]:
    """Return the arguments of rclpy.init() that choose the enclave of a name; none without security."""
    if os.environ.get(ENABLE) != "true":  # no other spelling counts, as in ROS 2
        return []
    return ["--ros-args", "--enclave", path(name, namespace)]
