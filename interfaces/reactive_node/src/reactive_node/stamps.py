"""Timestamps, and conversions between ROS and Python time.

DDS source times are in the time of day, even while ROS time is simulated.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from builtin_interfaces.msg import Time
from reactivex.operators._timestamp import Timestamp

__all__ = [
    "Timestamp",
    "from_message",
    "from_nanoseconds",
    "now",
    "to_message",
    "to_nanoseconds",
]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


def now() -> datetime:
    """Return the time of day."""
    return datetime.now(UTC)


def from_nanoseconds(nanoseconds: int) -> datetime:
    """Convert nanoseconds since 1970, rounding down to microseconds."""
    return _EPOCH + timedelta(microseconds=nanoseconds // 1000)


def to_nanoseconds(time: datetime) -> int:
    """Convert to nanoseconds since 1970."""
    return (time - _EPOCH) // _MICROSECOND * 1000


def from_message(stamp: Time) -> datetime:
    """Convert a ROS time, rounding down to microseconds."""
    return from_nanoseconds(stamp.sec * 10**9 + stamp.nanosec)


def to_message(time: datetime) -> Time:
    """Convert to a ROS time."""
    seconds, nanoseconds = divmod(to_nanoseconds(time), 10**9)
    return Time(sec=seconds, nanosec=nanoseconds)
