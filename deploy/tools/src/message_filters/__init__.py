"""Filters of messages: a history, and groups of messages with the same or similar stamps.

The API is that of ROS 2's message_filters for Python. A filter calls its callbacks with one message, or with
one message of each input.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rclpy.clock import ROSClock
from rclpy.duration import Duration
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.time import Time


class SimpleFilter:
    """Base of filters: passes messages to its callbacks."""

    def __init__(self) -> None:
        self.callbacks: dict[int, tuple[Callable[..., Any], tuple[Any, ...]]] = {}

    def registerCallback(self, cb: Callable[..., Any], *args: Any) -> int:
        """Call ``cb`` with the messages of each output, then ``args``; return the number of the callback."""
        connection = len(self.callbacks)
        self.callbacks[connection] = (cb, args)
        return connection

    def signalMessage(self, *msg: Any) -> None:
        for callback, args in self.callbacks.values():
            callback(*msg, *args)


class Subscriber(SimpleFilter):
    """Outputs the messages of a topic. Other attributes are those of its subscription, ``sub``."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Subscribe: ``Subscriber(node, msg_type, topic, **options)``, with ``qos_profile`` 10 by default."""
        super().__init__()
        self.node: Node = args[0]
        self.topic: str = args[2]
        kwargs.setdefault("qos_profile", 10)
        self.sub = self.node.create_subscription(*args[1:], self.callback, **kwargs)

    def callback(self, msg: Any) -> None:
        self.signalMessage(msg)

    def getTopic(self) -> str:
        """Return the name of the topic as it was given."""
        return self.topic

    def __getattr__(self, key: str) -> Any:
        if key == "sub":  # not there yet
            raise AttributeError(key)
        return getattr(self.sub, key)


class Cache(SimpleFilter):
    """Keeps the last messages of a filter, and outputs each message."""

    def __init__(self, f: SimpleFilter, cache_size: int = 1, allow_headerless: bool = False) -> None:
        """Keep the last ``cache_size`` messages of ``f``.

        :param allow_headerless: whether a message without header gets the time of its arrival; otherwise it
            is ignored.
        """
        super().__init__()
        self.connectInput(f)
        self.cache_size = cache_size
        self.cache_msgs: list[Any] = []
        self.cache_times: list[Time] = []
        self.allow_headerless = allow_headerless

    def connectInput(self, f: SimpleFilter) -> None:
        self.incoming_connection = f.registerCallback(self.add)

    def add(self, msg: Any) -> None:
        stamp = _stamp(msg, self.allow_headerless, "message_filters_cache")
        if stamp is None:
            return
        self.cache_times.append(stamp)
        self.cache_msgs.append(msg)
        if len(self.cache_msgs) > self.cache_size:
            del self.cache_msgs[0], self.cache_times[0]
        self.signalMessage(msg)

    def getInterval(self, from_stamp: Time, to_stamp: Time) -> list[Any]:
        """Return the messages between two times, inclusive."""
        assert from_stamp <= to_stamp, "the interval ends before it begins"
        return [msg for msg, time in self._message_filters_items() if from_stamp <= time <= to_stamp]

    def getElemAfterTime(self, stamp: Time) -> Any:
        """Return the first message at or after a time, ``None`` without one."""
        return next((msg for msg, time in self._message_filters_items() if time >= stamp), None)

    def getElemBeforeTime(self, stamp: Time) -> Any:
        """Return the last message at or before a time, ``None`` without one."""
        return next((msg for msg, time in reversed(self._message_filters_items()) if time <= stamp), None)

    def getLastestTime(self) -> Time | None:
        """Return the time of the last message, ``None`` without one."""
        return self.cache_times[-1] if self.cache_times else None

    def getOldestTime(self) -> Time | None:
        """Return the time of the first message, ``None`` without one."""
        return self.cache_times[0] if self.cache_times else None

    def getLast(self) -> Any:
        """Return the first message with the time of the last one or later, ``None`` without one."""
        latest = self.getLastestTime()
        return None if latest is None else self.getElemAfterTime(latest)

    def _message_filters_items(self) -> list[tuple[Any, Time]]:
        return list(zip(self.cache_msgs, self.cache_times, strict=True))


class TimeSynchronizer(SimpleFilter):
    """Outputs one message of each input when all have the same stamp in their header."""

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int) -> None:
        """Take the messages of ``fs``; of each, the ``queue_size`` latest wait for the others."""
        super().__init__()
        self.connectInput(fs)
        self.queue_size = queue_size
        self.lock = threading.RLock()

    def connectInput(self, fs: Sequence[SimpleFilter]) -> None:
        self.queues: list[dict[int, Any]] = [{} for _ in fs]  # by stamp [ns]
        self.input_connections = [
            f.registerCallback(self.add, queue, index)
            for index, (f, queue) in enumerate(zip(fs, self.queues, strict=True))
        ]

    def add(self, msg: Any, my_queue: dict[int, Any], my_queue_index: int | None = None) -> None:
        with self.lock:
            self._message_filters_enqueue(msg, Time.from_msg(msg.header.stamp).nanoseconds, my_queue)
            for stamp in sorted(set.intersection(*map(set, self.queues))):
                self._message_filters_output([stamp] * len(self.queues))

    def _message_filters_enqueue(self, msg: Any, stamp: int, queue: dict[int, Any]) -> None:
        queue[stamp] = msg
        while len(queue) > self.queue_size:
            del queue[min(queue)]

    def _message_filters_output(self, stamps: Sequence[int]) -> None:
        """Remove the messages with these stamps, one for each input, and output them."""
        self.signalMessage(*[queue.pop(stamp) for queue, stamp in zip(self.queues, stamps, strict=True)])


class ApproximateTimeSynchronizer(TimeSynchronizer):
    """Outputs one message of each input when their stamps are similar."""

    def __init__(
        self, fs: Sequence[SimpleFilter], queue_size: int, slop: float, allow_headerless: bool = False
    ) -> None:
        """Take the messages of ``fs``; of each, the ``queue_size`` latest wait for the others.

        :param slop: all stamps of a group differ by less than this [s].
        :param allow_headerless: whether a message without header gets the time of its arrival; otherwise it
            is ignored.
        """
        super().__init__(fs, queue_size)
        self.slop = Duration(seconds=slop)
        self.allow_headerless = allow_headerless

    def add(self, msg: Any, my_queue: dict[int, Any], my_queue_index: int | None = None) -> None:
        """Take a message of an input: the messages closest to it in time make a group with it."""
        time = _stamp(msg, self.allow_headerless, "message_filters_approx")
        if time is None:
            return
        new, slop = time.nanoseconds, self.slop.nanoseconds
        with self.lock:
            self._message_filters_enqueue(msg, new, my_queue)
            candidates = [
                [new] if index == my_queue_index else _closest(queue, new, slop)
                for index, queue in enumerate(self.queues)
            ]
            for stamps in itertools.product(*candidates):
                known = all(stamp in queue for stamp, queue in zip(stamps, self.queues, strict=True))
                if known and max(stamps) - min(stamps) < slop:
                    self._message_filters_output(stamps)
                    break


def _closest(stamps: Iterable[int], to: int, slop: int) -> list[int]:
    """Return the stamps that differ by at most ``slop``, the closest first."""
    return sorted((stamp for stamp in stamps if abs(stamp - to) <= slop), key=lambda stamp: abs(stamp - to))


def _stamp(msg: Any, allow_headerless: bool, logger: str) -> Time | None:
    """Return the time of a message, ``None`` if it has none."""
    stamp = getattr(getattr(msg, "header", None), "stamp", None)
    if stamp is not None:
        return stamp if isinstance(stamp, Time) else Time.from_msg(stamp)
    if allow_headerless:
        return ROSClock().now()
    get_logger(logger).warning(
        f"Ignoring a message of type {type(msg).__name__}, as it has no stamp in a header. With "
        "allow_headerless=True it gets the time of its arrival."
    )
    return None
