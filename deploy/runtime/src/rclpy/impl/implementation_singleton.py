"""The place where rclpy keeps its C extension; see `rclpy._rclpy_pybind11` for what there is of it."""

from __future__ import annotations

from rclpy import _rclpy_pybind11 as rclpy_implementation

__all__ = ["rclpy_implementation"]
