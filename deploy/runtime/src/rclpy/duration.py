"""Durations in whole nanoseconds."""

from __future__ import annotations

from functools import total_ordering
from typing import Protocol

import builtin_interfaces.msg
from rclpy.constants import S_TO_NS

_MIN = -(2**63)
_MAX = 2**63 - 1


class DurationType(Protocol):
    """The result of `Duration.get_c_duration`: an object with the nanoseconds."""

    @property
    def nanoseconds(self) -> int: ...


@total_ordering
class Duration:
    """A duration, possibly negative, with a resolution of one nanosecond."""

    __slots__ = ("__weakref__", "_rclpy_nanoseconds")

    # Not hashable, as rclpy's Duration.
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, *, seconds: int | float = 0, nanoseconds: int = 0):
        """Create `seconds` plus `nanoseconds`, in whole nanoseconds. Raises OverflowError beyond 64 bits."""
        total = int(seconds * S_TO_NS) + int(nanoseconds)
        if not _MIN <= total <= _MAX:
            raise OverflowError("Total nanoseconds value is too large to store in C duration.")
        self._rclpy_nanoseconds = total

    @property
    def nanoseconds(self) -> int:
        """The duration [ns]."""
        return self._rclpy_nanoseconds

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self._rclpy_nanoseconds})"

    def __str__(self) -> str:
        return "Infinite" if self._rclpy_nanoseconds == _MAX else f"{self._rclpy_nanoseconds} nanoseconds"

    def __eq__(self, other: object) -> bool:
        return (
            self._rclpy_nanoseconds == other._rclpy_nanoseconds
            if isinstance(other, Duration)
            else NotImplemented
        )

    def __lt__(self, other: object) -> bool:
        return (
            self._rclpy_nanoseconds < other._rclpy_nanoseconds
            if isinstance(other, Duration)
            else NotImplemented
        )

    def to_msg(self) -> builtin_interfaces.msg.Duration:
        """Convert to a message. Its nanoseconds are never negative: -0.1 s is -1 s + 900,000,000 ns."""
        seconds, nanoseconds = divmod(self._rclpy_nanoseconds, S_TO_NS)
        return builtin_interfaces.msg.Duration(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: builtin_interfaces.msg.Duration) -> Duration:
        """Convert from a message. Raises TypeError if `msg` is not a `builtin_interfaces.msg.Duration`."""
        if not isinstance(msg, builtin_interfaces.msg.Duration):
            raise TypeError("Must pass a builtin_interfaces.msg.Duration object")
        return cls(seconds=msg.sec, nanoseconds=msg.nanosec)

    def get_c_duration(self) -> DurationType:
        """Return the duration itself; in rclpy, a structure of C."""
        return self


Infinite = Duration(nanoseconds=_MAX)
"""Infinite duration (`RMW_DURATION_INFINITE`)."""
