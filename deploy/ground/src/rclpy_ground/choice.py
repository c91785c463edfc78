"""The ground of this interpreter."""

from __future__ import annotations

from rclpy_ground.interface import Ground

ground: Ground
"""What :func:`rclpy_ground.install` has chosen."""
