"""Velocities of frames, as means of transforms over an interval."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from rclpy.constants import S_TO_NS

from tf2_py._matrices import Matrix, Vector, rotation_of

Twist: TypeAlias = tuple[Vector, Vector]
"""A linear [m/s] and an angular [rad/s] velocity."""

_EARLIEST = 10_000
"""The time 0 would ask for the latest transform, so no interval begins before 10 µs."""


def average_velocity(
    lookup: Callable[[str, str, int], Matrix],
    tracking_frame: str,
    observation_frame: str,
    reference_frame: str,
    reference_point: Vector,
    reference_point_frame: str,
    time: int,
    interval: int,
    latest: int,
) -> Twist:
    """Return the velocity of a body around a time, see ``BufferCore.lookupVelocityFullCore``.

    The numbers are those of tf2.

    :param lookup: returns the transform to a frame, from a frame, at a time [ns].
    :param time: the middle of the interval [ns], unless it would end after ``latest``.
    :param interval: the length of the interval [ns].
    """
    end = min(time + interval // 2, latest)
    start = max(end - interval, _EARLIEST)
    seconds = (end - start) / S_TO_NS
    before = lookup(observation_frame, tracking_frame, start)
    after = lookup(observation_frame, tracking_frame, end)
    linear = (after[:3, 3] - before[:3, 3]) / seconds
    angular = before[:3, :3] @ _rotation_vector(before.T @ after) / seconds

    # of the point of the body at the origin of the reference frame
    to_reference = lookup(reference_frame, tracking_frame, time)
    origin = to_reference[:3, 3]
    angular = to_reference[:3, :3] @ angular
    swept: NDArray[Any] = np.cross(origin, angular)
    linear = to_reference[:3, :3] @ linear + swept

    # of the reference point
    point = lookup(reference_frame, reference_point_frame, time) @ (*reference_point, 1.0)
    linear = linear + angular * (point[:3] - origin)  # element by element, as tf2 does
    return _vector(linear), _vector(angular)


def _rotation_vector(matrix: Matrix) -> NDArray[np.float64]:
    """Return the axis of a rotation with the length of its angle [rad]."""
    x, y, z, w = rotation_of(matrix)
    length = math.hypot(x, y, z)
    factor = 2.0 * math.atan2(length, w) / length if length else 0.0
    return factor * np.array((x, y, z))


def _vector(array: NDArray[np.float64]) -> Vector:
    x, y, z = array.tolist()
    return x, y, z
