"""Rigid transforms as homogeneous matrices of shape (4, 4), and rotations as quaternions (x, y, z, w)."""

from __future__ import annotations

import math
import sys
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Matrix: TypeAlias = NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

_EPSILON = sys.float_info.epsilon

IDENTITY: Matrix = np.eye(4)


def matrix_of(translation: Vector, rotation: Quaternion) -> Matrix:
    """Return the transform that rotates, then translates; a ``rotation`` of length 0 does not rotate."""
    x, y, z, w = rotation
    square = x * x + y * y + z * z + w * w
    scale = 2.0 / square if square > _EPSILON else 0.0
    sx, sy, sz = scale * x, scale * y, scale * z
    tx, ty, tz = translation
    return np.array(
        (
            (1.0 - (sy * y + sz * z), sx * y - sz * w, sx * z + sy * w, tx),
            (sx * y + sz * w, 1.0 - (sx * x + sz * z), sy * z - sx * w, ty),
            (sx * z - sy * w, sy * z + sx * w, 1.0 - (sx * x + sy * y), tz),
            (0.0, 0.0, 0.0, 1.0),
        )
    )


def inverse(matrix: Matrix) -> Matrix:
    inverted = np.eye(4)
    inverted[:3, :3] = matrix[:3, :3].T
    inverted[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return inverted


def translation_of(matrix: Matrix) -> Vector:
    x, y, z = matrix[:3, 3].tolist()
    return x, y, z


def rotation_of(matrix: Matrix) -> Quaternion:
    """Return the rotation of a transform as a unit quaternion.

    One component is not close to 0 and divides the others (Shepperd, 1978). It is positive, as in tf2: w if
    the angle is less than 120°, and otherwise the largest of x, y and z.
    """
    rows = matrix[:3, :3].tolist()
    trace = rows[0][0] + rows[1][1] + rows[2][2]
    if trace > 0.0:
        double = math.sqrt(1.0 + trace)  # 2 w
        half = 0.5 / double
        return (
            (rows[2][1] - rows[1][2]) * half,
            (rows[0][2] - rows[2][0]) * half,
            (rows[1][0] - rows[0][1]) * half,
            0.5 * double,
        )
    i = max(range(3), key=lambda axis: rows[axis][axis])
    j, k = (i + 1) % 3, (i + 2) % 3
    double = math.sqrt(1.0 + rows[i][i] - rows[j][j] - rows[k][k])
    half = 0.5 / double
    vector = [0.0, 0.0, 0.0]
    vector[i] = 0.5 * double
    vector[j] = (rows[i][j] + rows[j][i]) * half
    vector[k] = (rows[i][k] + rows[k][i]) * half
    return vector[0], vector[1], vector[2], (rows[k][j] - rows[j][k]) * half


def slerp(one: Quaternion, two: Quaternion, ratio: float) -> Quaternion:
    """Return the rotation between two unit quaternions, at a constant velocity on the shorter way."""
    x1, y1, z1, w1 = one
    x2, y2, z2, w2 = two
    cosine = x1 * x2 + y1 * y2 + z1 * z2 + w1 * w2
    angle = math.acos(min(1.0, abs(cosine)))
    if angle == 0.0:
        return one
    a = math.sin((1.0 - ratio) * angle) / math.sin(angle)
    b = math.copysign(math.sin(ratio * angle) / math.sin(angle), cosine)
    return a * x1 + b * x2, a * y1 + b * y2, a * z1 + b * z2, a * w1 + b * w2
