"""Warns of known vulnerabilities of the middleware that other hosts can reach, of deploy/SAFETY.md."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

from deploy.supervision import rclpy_choice
from deploy.supervision.environment import RANGE, is_alone

FAST_DDS = "ros-fastrtps"
"""The wheel of Fast DDS."""
FIXED = (2, 14, 7)
"""The release of Fast DDS that has the fixes of all vulnerabilities known on 2026-11-29."""


def warning(environment: Mapping[str, str]) -> str:
    """Return a warning if other hosts can reach a middleware with known vulnerabilities; empty otherwise."""
    if is_alone(environment) or environment.get(rclpy_choice.RUNTIME) or rclpy_choice.sourced_rclpy():
        return ""
    try:
        found = version(FAST_DDS)
    except PackageNotFoundError:
        return ""
    if tuple(map(int, found.split("."))) >= FIXED:
        return ""
    return (
        f"WARNING: other hosts reach Fast DDS {found}, which lacks the fixes of 17 known vulnerabilities:"
        f" a few packets end a service. On one host, use {RANGE}=LOCALHOST; on two, keys (RUNTIME=cyclonedds"
        " SECURE=yes), an installed ROS 2 with Fast DDS 2.14.7, or a closed network (deploy/SAFETY.md)"
    )
