"""Compares two records of the same topics, message by message and field by field."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from heapq import merge
from itertools import islice, repeat
from math import inf
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message

from rclpy_simulation.host import SECOND
from rclpy_simulation.replay.bag import Bag, Recorded

_CANDIDATES = 8  # messages that one is compared with


class Bounds(NamedTuple):
    """By how much equal messages may differ."""

    time: float = 0.1
    """Of their sending, and of stamps in them [s]."""
    value: float = 0.0
    """Of numbers with a point."""


class Difference(NamedTuple):
    """A message without an equal one."""

    time: int
    """[ns since 1970]."""
    reason: str


@dataclass
class Comparison:
    topic: str
    recorded: int = 0
    replayed: int = 0
    differing: int = 0
    """Messages of either side without an equal one."""
    first: Difference | None = None


class _Message:
    """A message that is deserialized when it is needed."""

    def __init__(self, recorded: Recorded, message_type: Any) -> None:
        self.time = recorded.time
        self.data = recorded.data
        self._type = message_type
        self._content: Any = None

    @property
    def content(self) -> Any:
        if self._content is None:
            self._content = deserialize_message(self.data, self._type)
        return self._content


def compare(
    recorded: Bag, replayed: Bag, topics: Iterable[str], begin: int, end: int, bounds: Bounds
) -> list[Comparison]:
    """Compare the messages of topics that were sent from ``begin`` to ``end`` [ns since 1970].

    A message has an equal one if the other record has one near in time whose fields are equal.
    """
    found = {}
    for name in sorted(topics):
        found[name] = _Topic(name, recorded.message_type(recorded.topics[name]), bounds, begin, end)
    margin = round(bounds.time * SECOND)
    streams = [
        zip(bag.messages(found.keys(), begin - margin, end + margin), repeat(i))
        for i, bag in enumerate((recorded, replayed))
    ]
    for message, side in merge(*streams, key=lambda each: each[0].time):
        found[message.topic].note(side, message)
    return [topic.result() for topic in found.values()]


class _Topic:
    """The messages of a topic on both sides that have no equal one yet: 0 is recorded, 1 is replayed."""

    def __init__(self, name: str, message_type: Any, bounds: Bounds, begin: int, end: int) -> None:
        self._comparison = Comparison(name)
        self._begin = begin
        self._end = end
        self._type = message_type
        self._bounds = bounds
        self._limit = round(bounds.time * SECOND)
        self._waiting: tuple[deque[_Message], deque[_Message]] = deque(), deque()
        self._counts = [0, 0]

    def note(self, side: int, message: Recorded) -> None:
        self._expire(message.time - self._limit)
        this, others = _Message(message, self._type), self._waiting[1 - side]
        for other in islice(others, _CANDIDATES):
            if this.data == other.data or not difference(this.content, other.content, self._bounds):
                others.remove(other)
                self._counts[0] += 1
                self._counts[1] += 1
                return
        self._waiting[side].append(this)

    def _expire(self, before: float) -> None:
        """Note that messages have no equal one; two that are near in time are one difference."""
        while found := [
            side for side in (0, 1) if self._waiting[side] and self._waiting[side][0].time < before
        ]:
            side = min(found, key=lambda each: self._waiting[each][0].time)
            this, others = self._waiting[side].popleft(), self._waiting[1 - side]
            reason = f"{'replayed' if side else 'recorded'} only"
            if others and others[0].time - this.time <= self._limit:
                pair = this.content, others.popleft().content
                reason = difference(*(pair[::-1] if side else pair), self._bounds)
                self._counts[1 - side] += 1
            elif not self._begin <= this.time <= self._end:
                continue  # its equal one may be outside of the record
            self._counts[side] += 1
            self._comparison.differing += 1
            if self._comparison.first is None:
                self._comparison.first = Difference(this.time, reason)

    def result(self) -> Comparison:
        self._expire(inf)
        self._comparison.recorded, self._comparison.replayed = self._counts
        return self._comparison


def difference(recorded: Any, replayed: Any, bounds: Bounds, path: str = "") -> str:
    """Return the first field in which two messages differ, with both values; empty if they are equal."""
    if isinstance(recorded, Time):
        times = [each.sec + each.nanosec / SECOND for each in (recorded, replayed)]
        is_equal = recorded == replayed or abs(times[0] - times[1]) <= bounds.time
        return "" if is_equal else f"{path}: recorded {times[0]:.6f}, replayed {times[1]:.6f}"
    if hasattr(recorded, "get_fields_and_field_types"):
        for name in recorded.get_fields_and_field_types():
            values = getattr(recorded, name), getattr(replayed, name)
            if found := difference(*values, bounds, f"{path}.{name}" if path else name):
                return found
        return ""
    if isinstance(recorded, (str, bytes)) or not hasattr(recorded, "__len__"):
        is_equal = recorded == replayed or (recorded != recorded and replayed != replayed)  # not a number
        if not is_equal and isinstance(recorded, float):
            is_equal = abs(recorded - replayed) <= bounds.value
        return "" if is_equal else f"{path}: recorded {recorded!r}, replayed {replayed!r}"
    if len(recorded) != len(replayed):
        return f"{path}: recorded {len(recorded)} elements, replayed {len(replayed)}"
    if hasattr(recorded, "tobytes") and recorded.tobytes() == replayed.tobytes():
        return ""
    pairs = enumerate(zip(recorded, replayed, strict=True))
    return next((found for i, pair in pairs if (found := difference(*pair, bounds, f"{path}[{i}]"))), "")
