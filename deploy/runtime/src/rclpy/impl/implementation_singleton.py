"""The module through which rclpy accesses its C extension; here see `rclpy._rclpy_pybind11`."""

from __future__ import annotations

from rclpy import _rclpy_pybind11 as rclpy_implementation

__all__ = ["rclpy_implementation"]
