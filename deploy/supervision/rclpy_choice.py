"""Which rclpy a command runs on. Standard library only: `make setup` works without .venv."""

from __future__ import annotations

import importlib.machinery
import os
from pathlib import Path

from deploy.supervision.processes import ROOT

RUNTIME = "RUNTIME"
"""Environment variable: what rclpy stands on, "cyclonedds", or "" for the middleware of ROS 2."""
CYCLONEDDS = "cyclonedds"
GROUND = "RCLPY_GROUND"
"""The environment variable of rclpy_ground: in .venv, RUNTIME sets it."""


def words() -> str:
    """Name the rclpy of this environment for the user."""
    if file := sourced_rclpy():
        return f"rclpy of the sourced ROS 2 ({file})"
    return "rclpy of ROS 2's wheels" + (" on Cyclone DDS" if os.environ.get(RUNTIME) else "")


def sourced_rclpy() -> str:
    """The file of the rclpy of a sourced ROS 2, which is in PYTHONPATH; '' without one."""
    path = [entry for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    spec = importlib.machinery.PathFinder.find_spec("rclpy", path)
    origin = (spec and spec.origin) or ""
    return "" if Path(origin).is_relative_to(ROOT) else origin
