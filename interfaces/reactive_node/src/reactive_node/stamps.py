"""Times of messages as ``datetime``.

DDS source times and stamps count by the time of day, even while ROS time is simulated. That clock may be set,
and may differ between hosts. Where safety depends on an age, take only the age at arrival from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Generic, TypeVar

from builtin_interfaces.msg import Time
from reactivex import Observable

__all__ = [
    "Timestamp",
    "fresh",
    "from_message",
    "from_nanoseconds",
    "latest",
    "now",
    "to_message",
    "to_nanoseconds",
]

_T = TypeVar("_T")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)
IN_STEP = timedelta(milliseconds=50)
"""By how much the clocks of two hosts may differ that NTP or PTP keeps in step (deploy/SAFETY.md, A3)."""


@dataclass(slots=True)
class Timestamp(Generic[_T]):
    """A value and its time, with the attributes of the items that RxPY's ``timestamp`` operator emits."""

    value: _T
    timestamp: datetime


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


def fresh(
    items: Observable[Timestamp[Any]],
    *,
    lifespan: float,
    now: Callable[[], datetime] = now,
    dropped: Callable[[str], None] = lambda why: None,
) -> Observable[Timestamp[Any]]:
    """
    Emit the items whose source time is now, give or take ``lifespan`` [s]: none that waited in a queue.

    :param dropped: is told of the others, why they are not emitted.
    """

    def is_fresh(item: Timestamp[Any]) -> bool:
        age = (now() - item.timestamp).total_seconds()
        if abs(age) <= lifespan:
            return True
        dropped(f"it is {age:.3f} s old" if age > 0 else f"its clock is {-age:.3f} s ahead of ours")
        return False

    return items.filter(is_fresh)


def latest(
    stamps: Observable[datetime],
    *,
    now: Callable[[], datetime] = now,
    dropped: Callable[[str], None] = lambda why: None,
) -> Observable[datetime]:
    """
    Emit when the latest of what is stamped was, by the scheduler's clock, which nobody sets.

    It is as old as its stamp says when it arrives, and ages by the scheduler's clock from then on. One from
    the future, by more than two clocks that are kept in step may differ, or of before the last one, counts
    for nothing.

    :param dropped: is told of those from the future.
    """

    def moment(stamp: Timestamp[datetime]) -> datetime | None:
        age = now() - stamp.value
        if age < -IN_STEP:
            dropped(f"it is stamped by a clock that is {-age.total_seconds():.3f} s ahead of ours")
            return None
        return stamp.timestamp - max(age, timedelta(0))

    return stamps.timestamp().map(moment).filter(bool).scan(max)
