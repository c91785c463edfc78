"""Checks the size, form and content of each message of another process before any other code sees it.

A message is data, no matter who sent it. A bad message adds its reason to the health of the reader, and is
never an exception. The size comes first: a message with a false length of a sequence takes 250 times as much
memory as it has octets.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Any

from rclpy.serialization import deserialize_message
from reactivex import Observable

from interfaces.topics import Topic
from reactive_node import ReactiveNode

Drop = Callable[[str, str], None]
"""Is called with the name of a topic and what is wrong with a message of it."""


_ANOTHER_CLOCK = 86_400.0  # s: such an age says nothing about the message


def unreported(topic: str, reason: str) -> None:
    """Drop a message without a report: the reader has no health, and services report the same message."""


def not_fresh(age: float, oldest: float, ahead: float) -> str:
    """Return why a message does not count, by the age of its time [s]; empty if it does.

    :param oldest, ahead: the greatest age, and by how much its clock may be ahead of ours [s].
    """
    if -ahead <= age <= oldest:
        return ""
    if abs(age) > _ANOTHER_CLOCK:
        side = "before" if age > 0 else "ahead of"
        source = "a simulation (use_sim_time), a record, or a wrong clock"
        return f"its time is more than a day {side} ours: {source}"
    return f"it is {age:.3f} s old" if age > 0 else f"its clock is {-age:.3f} s ahead of ours"


def reading(
    topic: Topic,
    drop: Drop,
    *,
    timestamped: bool = False,
    staleness: Callable[[datetime], str] | None = None,
) -> dict[str, Any]:
    """Return the options of :meth:`ReactiveNode.create_observable` for the good values of a topic.

    :param timestamped: whether items are the values with their DDS source times.
    :param staleness: returns why a message of a source time is not good; empty if it is.
    """
    type_, value_of, problem_of, largest = topic.type, topic.value, topic.problem, topic.largest
    with_time = timestamped or staleness is not None

    def good(received: Any) -> Any:
        """Return the value of a message. All in one step: every message takes this path."""
        data = received.value if with_time else received
        if len(data) > largest:
            drop(topic.name, f"more than {largest} octets")
            return None
        try:
            value = value_of(deserialize_message(data, type_))
        except (ArithmeticError, MemoryError, RuntimeError, ValueError):  # RMWError is a RuntimeError
            drop(topic.name, f"cannot deserialize {len(data)} bytes as {topic.type_name}")
            return None
        problem = problem_of(value)
        if not problem and staleness is not None:
            problem = staleness(received.timestamp)
        if problem:
            drop(topic.name, problem)
            return None
        return received._replace(value=value) if timestamped else value

    # Raw: the size is known before the message is deserialized, and rclpy on Cyclone DDS would deliver a
    # truncated message as one of zeros.
    return {"timestamped": with_time, "item": good, "raw": True}


def observe(node: ReactiveNode, topic: Topic, drop: Drop, *, timestamped: bool = False) -> Observable[Any]:
    """Return the good values of a topic, for a node that is no service."""
    options = reading(topic, drop, timestamped=timestamped)
    return node.create_observable(topic.type, topic.name, topic.qos, **options)
