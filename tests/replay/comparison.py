"""Compares replayed messages with the recorded ones, within bounds."""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from rclpy_simulation.host import SECOND

from interfaces import topics
from interfaces.topics import Topic
from tests.promises.observations import time_sent
from tests.replay.record import Message

COUNT, FEW = 0.1, 5
"""The numbers of messages may differ by this part, and by this number. So many may be lost in any record."""

Interval = tuple[int, int]
Value = tuple[float, ...] | str


class Bounds(NamedTuple):
    """How much replayed messages of a topic may differ from the recorded ones."""

    value: float = 0.0
    """A message with this deviation is equal."""
    unit: str = ""
    time: float = 0.6
    """In which time an equal message must come [s]: a period of the watchdog's samples, with a margin."""
    lost: float = 0.0
    """The part that may have no equal message: a busy machine loses samples of readers that keep one."""
    near: float = 0.0
    """The deviation that those may have."""
    burst: float = 0.02
    """Messages that follow one another faster are a burst, and only its last one is compared [s]: no record
    shows the order in which samples of several writers arrive. It changes no answer of a signal."""

    def __str__(self) -> str:
        parts = [f"{self.value:g} {self.unit}".strip()] if self.value else []
        parts.append(f"{self.time:g} s")
        if self.lost:
            parts.append(f"{self.lost:.0%} lost")
        return ", ".join(parts)


BOUNDS: dict[str, Bounds] = {
    topics.EFFECTOR_POSITION.name: Bounds(1e-9, "m", 0.25, lost=0.05, near=0.2),
    topics.EFFECTOR_SPEED.name: Bounds(1e-9, "m/s", 0.25, lost=0.1, near=math.inf),
    topics.EFFECTOR_TWIST.name: Bounds(1e-9, "m/s", 0.25, lost=0.1, near=math.inf, burst=0.0),
    topics.JOINT_STATES.name: Bounds(1e-9, "rad", 0.25, lost=0.1, near=0.1, burst=0.0),
    topics.TF.name: Bounds(1e-9, "", 0.25, lost=0.1, near=0.1, burst=0.0),
    topics.ROBOT_DESCRIPTION.name: Bounds(0.1, "m", 1.25),
    topics.OPERATOR_PRESENCE.name: Bounds(0.25, "s"),
    topics.OPERATOR_ACTIVITY.name: Bounds(),
    topics.ENGINES.name: Bounds(),
    topics.ENGINES_STATE.name: Bounds(),
}
"""By topic. A speed between messages of a burst is that of their jitter, so a lost one may be any number."""


class Difference(NamedTuple):
    """A message without an equal one."""

    time: int
    """[ns since 1970]."""
    recorded: str
    """The content; empty if nothing was recorded at that time."""
    replayed: str


@dataclass
class Comparison:
    topic: str
    bounds: Bounds
    recorded: int
    replayed: int
    compared: int = 0
    """Messages of both sides."""
    value: float = 0.0
    """The largest deviation of equal messages."""
    time: float = 0.0
    """The largest time between equal messages [s]."""
    differences: list[Difference] = field(default_factory=list)
    is_equal: bool = True


class _Item(NamedTuple):
    time: int
    value: Value


def compare(
    topic: Topic,
    recorded: Sequence[Message],
    replayed: Sequence[Message],
    excused: Sequence[Interval],
    offsets: Collection[int] = (),
) -> Comparison:
    """Compare the messages of a topic.

    :param excused: times in which nothing is compared [ns since 1970].
    :param offsets: by which the arm's time of day has been ahead [ns].
    """
    bounds = BOUNDS[topic.name]
    result = Comparison(topic.name, bounds, len(recorded), len(replayed))
    one, other = (
        [_Item(sent, _value(topic, sent, data, offsets)) for sent, data in it] for it in (recorded, replayed)
    )
    counts, far = [], 0
    for items, others, is_recorded in ((one, other, True), (other, one, False)):
        compared = _compared(items, excused, bounds)
        counts.append(len(compared))
        result.compared += len(compared)
        times = [item.time for item in others]
        for item in compared:
            best, nearest = _find(item, others, times, bounds)
            if best is not None:
                result.value = max(result.value, _deviation(item.value, best.value))
                result.time = max(result.time, abs(best.time - item.time) / SECOND)
                continue
            far += nearest is None or not _deviation(item.value, nearest.value) <= bounds.near
            texts = _text(item.value), _text(nearest.value) if nearest else ""
            result.differences.append(Difference(item.time, *(texts if is_recorded else texts[::-1])))
    result.differences.sort()
    few = len(result.differences) <= (max(FEW, bounds.lost * result.compared) if bounds.lost else 0)
    alike = abs(counts[0] - counts[1]) <= max(FEW, COUNT * counts[0])
    result.is_equal = few and alike and not far
    return result


def _compared(items: Sequence[_Item], excused: Sequence[Interval], bounds: Bounds) -> list[_Item]:
    """Return the last message of each burst, without the excused ones."""
    remaining = sorted(excused, reverse=True)
    until = 0
    found = []
    for number, item in enumerate(items):
        while remaining and remaining[-1][0] <= item.time:
            until = max(until, remaining.pop()[1])
        is_last = number + 1 == len(items) or items[number + 1].time - item.time >= bounds.burst * SECOND
        if is_last and item.time > until:
            found.append(item)
    return found


def _find(
    item: _Item, others: Sequence[_Item], times: Sequence[int], bounds: Bounds
) -> tuple[_Item | None, _Item | None]:
    """Return the equal message that is nearest in time, and the one that is nearest in value."""
    span = round(bounds.time * SECOND)
    low, high = bisect_left(times, item.time - span), bisect_right(times, item.time + span)
    within = sorted(others[low:high], key=lambda other: abs(other.time - item.time))
    for other in within:
        if _deviation(item.value, other.value) <= bounds.value:
            return other, other
    return None, min(within, key=lambda other: _deviation(item.value, other.value), default=None)


def _deviation(one: Value, other: Value) -> float:
    if isinstance(one, str) or isinstance(other, str) or len(one) != len(other):
        return 0.0 if one == other else math.inf
    return max((abs(a - b) for a, b in zip(one, other, strict=True)), default=0.0)


_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


def _pose(message: Any) -> tuple[float, ...]:
    found: list[float] = []
    for each in message.transforms:
        shift, turn = each.transform.translation, each.transform.rotation
        found += (shift.x, shift.y, shift.z, turn.x, turn.y, turn.z, turn.w)
    return tuple(found)


def _velocity(message: Any) -> tuple[float, ...]:
    return message.twist.linear.x, message.twist.linear.y, message.twist.angular.z


_READ: dict[str, Callable[[Any], Value]] = {
    topics.EFFECTOR_POSITION.name: lambda message: (message.point.x, message.point.y),
    topics.EFFECTOR_SPEED.name: lambda message: (message.data,),
    topics.EFFECTOR_TWIST.name: _velocity,
    topics.JOINT_STATES.name: lambda message: tuple(message.position),
    topics.TF.name: _pose,
    topics.ROBOT_DESCRIPTION.name: lambda message: tuple(map(float, _NUMBER.findall(message.data))),
}


def _value(topic: Topic, sent: int, data: bytes, offsets: Collection[int]) -> Value:
    """Return the content of a message that has to be equal, without the time of its emission."""
    try:
        message = deserialize_message(data, topic.type)
    except Exception as error:  # of any type, by the runtime
        return f"unreadable: {type(error).__name__}"
    if topic is topics.OPERATOR_PRESENCE:
        stamp = message.stamp.sec * SECOND + message.stamp.nanosec
        return ((sent - time_sent(sent, stamp, offsets, SECOND)) / SECOND,)
    return _READ.get(topic.name, lambda it: str(it.data))(message)


def _text(value: Value) -> str:
    if isinstance(value, str):
        return value
    numbers = [f"{number:.6g}" for number in value[:4]]
    return f"({', '.join(numbers)}{', …' if len(value) > 4 else ''})" if len(value) > 1 else numbers[0]
