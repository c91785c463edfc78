"""Times of messages as ``datetime``.

There are three clocks. DDS source times count by the time of day, even while ROS time is simulated. The
stamps of headers count by ROS time, which is the time of day or that of a simulation;
:func:`reactive_node.ros_time.in_ros_time` turns the one into the other. Both may be set, and may differ
between hosts. The steady clock of a host is never set: where safety depends on an age, take only the age at
arrival from the others.
"""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta
from typing import Any, Generic, NamedTuple, TypeVar

from builtin_interfaces.msg import Time

__all__ = [
    "UNSTAMPED",
    "Timestamp",
    "stamped",
    "time_message",
    "by_header",
    "from_message",
    "from_nanoseconds",
    "now",
    "to_message",
    "to_nanoseconds",
]

UNSTAMPED = -1
"""In the place of a stamp that is 0 [ns]: a simulation, and virtual time, may begin at 0."""
_T = TypeVar("_T")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


class _Stamped(NamedTuple, Generic[_T]):
    value: _T
    nanoseconds: int


class Timestamp(_Stamped[_T]):
    """A value and its time, with the attributes of the items that RxPY's ``timestamp`` operator emits.

    Its time is kept in nanoseconds since 1970: most messages need no :attr:`timestamp`, which costs more.
    """

    __slots__ = ()

    def __new__(cls, value: _T, timestamp: datetime) -> Timestamp[_T]:
        return tuple.__new__(cls, (value, to_nanoseconds(timestamp)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes a copy, to the nanosecond, which the constructor cannot."""
        return tuple.__new__, (type(self), tuple(self))

    @property
    def timestamp(self) -> datetime:
        """The time, rounded down to microseconds."""
        return from_nanoseconds(self.nanoseconds)

    def __repr__(self) -> str:
        return f"Timestamp({self.value!r}, {self.timestamp!r})"


def stamped(value: _T, nanoseconds: int) -> Timestamp[_T]:
    """Return a value with its time in nanoseconds since 1970, which a datetime would round."""
    return tuple.__new__(Timestamp, (value, nanoseconds))


def by_header(message: Any) -> Timestamp[Any]:
    """Return a message with the stamp of its header, a ROS time; :data:`UNSTAMPED` if nobody has set it."""
    stamp = message.header.stamp
    return stamped(message, stamp.sec * 10**9 + stamp.nanosec or UNSTAMPED)


def now() -> datetime:
    """Return the time of day."""
    return from_nanoseconds(time.time_ns())


def from_nanoseconds(nanoseconds: int) -> datetime:
    """Convert nanoseconds since 1970, rounding down to microseconds."""
    return _EPOCH + timedelta(0, 0, nanoseconds // 1000)  # for each message: a keyword costs 0.2 µs more


def to_nanoseconds(time: datetime) -> int:
    """Convert to nanoseconds since 1970."""
    return (time - _EPOCH) // _MICROSECOND * 1000


def from_message(stamp: Time) -> datetime:
    """Convert a ROS time, rounding down to microseconds."""
    return from_nanoseconds(stamp.sec * 10**9 + stamp.nanosec)


def to_message(time: datetime) -> Time:
    """Convert to a ROS time."""
    return time_message(to_nanoseconds(time))


def time_message(nanoseconds: int) -> Time:
    """Convert nanoseconds since 1970 to a ROS time."""
    seconds, rest = divmod(nanoseconds, 10**9)
    return Time(sec=seconds, nanosec=rest)
