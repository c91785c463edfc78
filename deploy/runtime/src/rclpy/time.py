"""Points in time of a clock."""

from __future__ import annotations

from functools import total_ordering
from typing import Protocol, overload

import builtin_interfaces.msg
from rclpy.clock_type import ClockType
from rclpy.constants import S_TO_NS
from rclpy.duration import Duration

_MAX = 2**63 - 1


class TimeHandle(Protocol):
    """A time in rclpy's C layer."""

    @property
    def nanoseconds(self) -> int: ...

    @property
    def clock_type(self) -> ClockType: ...


@total_ordering
class Time:
    """Nanoseconds since the epoch of a clock. Only times of one clock type can be compared and subtracted."""

    __slots__ = ("__weakref__", "_rclpy_clock_type", "_rclpy_nanoseconds")

    # Not hashable, as rclpy's Time.
    __hash__ = None  # type: ignore[assignment]

    def __init__(
        self,
        *,
        seconds: int | float = 0,
        nanoseconds: int = 0,
        clock_type: ClockType = ClockType.SYSTEM_TIME,
    ):
        """Create the time `seconds` plus `nanoseconds` after the epoch of `clock_type`.

        :raises TypeError: if `clock_type` is not a clock type.
        :raises ValueError: if `seconds` or `nanoseconds` are negative.
        :raises OverflowError: if the sum does not fit into 63 bits.
        """
        if not isinstance(clock_type, ClockType):
            raise TypeError("Clock type must be a ClockType enum")
        if seconds < 0:
            raise ValueError("Seconds value must not be negative")
        if nanoseconds < 0:
            raise ValueError("Nanoseconds value must not be negative")
        total = int(seconds * S_TO_NS) + int(nanoseconds)
        if total > _MAX:
            raise OverflowError("Total nanoseconds value is too large to store in C time point.")
        self._rclpy_nanoseconds = total
        self._rclpy_clock_type = clock_type

    @classmethod
    def _rclpy_of(cls, nanoseconds: int, clock_type: ClockType) -> Time:
        """Create a time from a clock's reading, without checks."""
        time: Time = object.__new__(cls)
        time._rclpy_nanoseconds = nanoseconds
        time._rclpy_clock_type = clock_type
        return time

    @property
    def nanoseconds(self) -> int:
        """The time since the epoch of the clock [ns]."""
        return self._rclpy_nanoseconds

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Return the whole seconds since the epoch, and the remaining nanoseconds."""
        return divmod(self._rclpy_nanoseconds, S_TO_NS)

    @property
    def clock_type(self) -> ClockType:
        return self._rclpy_clock_type

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self._rclpy_nanoseconds}, clock_type={self._rclpy_clock_type.name})"

    def __add__(self, other: Duration) -> Time:
        if not isinstance(other, Duration):
            return NotImplemented
        try:
            return Time(
                nanoseconds=self._rclpy_nanoseconds + other._rclpy_nanoseconds,
                clock_type=self._rclpy_clock_type,
            )
        except OverflowError as error:
            raise OverflowError("Addition leads to overflow in C storage.") from error

    def __radd__(self, other: Duration) -> Time:
        return self.__add__(other)

    @overload
    def __sub__(self, other: Time) -> Duration: ...

    @overload
    def __sub__(self, other: Duration) -> Time: ...

    def __sub__(self, other: Time | Duration) -> Time | Duration:
        if isinstance(other, Time):
            if self._rclpy_clock_type != other._rclpy_clock_type:
                raise TypeError("Can't subtract times with different clock types")
            return Duration(nanoseconds=self._rclpy_nanoseconds - other._rclpy_nanoseconds)
        if isinstance(other, Duration):
            try:
                return Time(
                    nanoseconds=self._rclpy_nanoseconds - other._rclpy_nanoseconds,
                    clock_type=self._rclpy_clock_type,
                )
            except ValueError as error:
                raise ValueError("Subtraction leads to negative time.") from error
        return NotImplemented

    def _rclpy_comparable(self, other: Time) -> int:
        if self._rclpy_clock_type != other._rclpy_clock_type:
            raise TypeError("Can't compare times with different clock types")
        return other._rclpy_nanoseconds

    def __eq__(self, other: object) -> bool:
        return (
            self._rclpy_nanoseconds == self._rclpy_comparable(other)
            if isinstance(other, Time)
            else NotImplemented
        )

    def __lt__(self, other: object) -> bool:
        return (
            self._rclpy_nanoseconds < self._rclpy_comparable(other)
            if isinstance(other, Time)
            else NotImplemented
        )

    def to_msg(self) -> builtin_interfaces.msg.Time:
        """Convert to a message, which does not contain the clock type."""
        seconds, nanoseconds = divmod(self._rclpy_nanoseconds, S_TO_NS)
        return builtin_interfaces.msg.Time(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: builtin_interfaces.msg.Time, clock_type: ClockType = ClockType.ROS_TIME) -> Time:
        """Convert from a message. Raises TypeError if `msg` is not a `builtin_interfaces.msg.Time`."""
        if not isinstance(msg, builtin_interfaces.msg.Time):
            raise TypeError("Must pass a builtin_interfaces.msg.Time object")
        return cls(seconds=msg.sec, nanoseconds=msg.nanosec, clock_type=clock_type)
