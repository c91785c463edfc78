"""A conversion between two clocks: from the time of day of DDS source times to ROS time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import reactivex as rx
from reactivex import Observable

from reactive_node.scheduler import NodeScheduler
from reactive_node.stamps import Timestamp

_T = TypeVar("_T")


def in_ros_time(
    clock: NodeScheduler,
) -> Callable[[Observable[Timestamp[_T]]], Observable[Timestamp[_T]]]:
    """Return an operator that turns source times into ROS times: ``samples.pipe(in_ros_time(clock))``.

    Both are the time of day, until ROS time is simulated. Nothing in a simulation says what its time was when
    a message was sent, so the message then counts from its arrival on. Two that arrive at one simulated time
    keep their order: they are a nanosecond apart.

    :param clock: ``node.scheduler``.
    """

    def operator(source: Observable[Timestamp[_T]]) -> Observable[Timestamp[_T]]:
        def begin(_: Any) -> Observable[Timestamp[_T]]:
            arrival, later = 0, 0

            def convert(sample: Timestamp[_T]) -> Timestamp[_T]:
                nonlocal arrival, later
                if not clock.is_simulated:
                    return sample
                now = max(clock.time_of_stamps(), 1)  # 0 would be no stamp
                later = later + 1 if now == arrival else 0
                arrival = now
                return sample._replace(nanoseconds=now + later)

            return source.map(convert)

        return rx.defer(begin)

    return operator
