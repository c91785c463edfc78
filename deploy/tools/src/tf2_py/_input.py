"""Conversion of times, and checks of frame IDs and received transforms."""

from __future__ import annotations

import math
from typing import Protocol, TypeAlias

from rclpy.constants import S_TO_NS

from tf2_py._matrices import Quaternion, Vector


class _SecAndNanosec(Protocol):
    sec: int
    nanosec: int


class _Nanoseconds(Protocol):
    @property
    def nanoseconds(self) -> int: ...


TimeLike: TypeAlias = _SecAndNanosec | _Nanoseconds
"""A time or duration of rclpy or of builtin_interfaces."""


def nanoseconds(time: TimeLike, what: str = "time") -> int:
    """Return a time or duration in nanoseconds. Raises TypeError."""
    if hasattr(time, "sec") and hasattr(time, "nanosec"):
        return int(time.sec) * S_TO_NS + int(time.nanosec)
    if hasattr(time, "nanoseconds"):
        return int(time.nanoseconds)
    raise TypeError(f"{what} must have sec and nanosec, or nanoseconds.")


def reason_against(frame: str) -> str:
    """Return why a string is no frame ID, or an empty string."""
    if not frame:
        return "in tf2 frame_ids cannot be empty"
    return "in tf2 frame_ids cannot start with a '/'" if frame.startswith("/") else ""


def problem_of(
    parent: str,
    child: str,
    authority: str,
    translation: Vector,
    rotation: Quaternion,
    length: float,
) -> str:
    """Return why a transform is invalid, or an empty string."""
    if child == parent:
        return (
            f'TF_SELF_TRANSFORM: Ignoring transform from authority "{authority}" with frame_id and '
            f' child_frame_id "{child}" because they are the same'
        )
    if not child:
        return (
            f'TF_NO_CHILD_FRAME_ID: Ignoring transform from authority "{authority}" because child_frame_id'
            " not set "
        )
    if not parent:
        return (
            f'TF_NO_FRAME_ID: Ignoring transform with child_frame_id "{child}"  from authority "{authority}"'
            " because frame_id not set"
        )
    if any(map(math.isnan, (*translation, *rotation))):
        return (
            f'TF_NAN_INPUT: Ignoring transform for child_frame_id "{child}" from authority "{authority}"'
            f" because of a nan value in the transform {_text(translation)} {_text(rotation)}"
        )
    if not 0.0 < length < math.inf:
        return (
            f'TF_DENORMALIZED_QUATERNION: Ignoring transform for child_frame_id "{child}" from authority'
            f' "{authority}" because of an invalid quaternion in the transform {_text(rotation)}'
        )
    return ""


def _text(numbers: tuple[float, ...]) -> str:
    return f"({' '.join(f'{number:f}' for number in numbers)})"
