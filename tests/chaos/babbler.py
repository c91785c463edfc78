"""A babbling publisher: it sends too much, or nonsense. Its messages and its process carry a mark. ::

python -m tests.chaos.babbler flood     10,000 heartbeats a second
python -m tests.chaos.babbler babble    NaN and random bytes on every topic
python -m tests.chaos.babbler pretend   presences of an operator who is not there
"""

from __future__ import annotations

import os
import random
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import TimeReference
from std_msgs.msg import Bool, Float64, Header, String

from deploy.supervision.environment import namespace_of
from interfaces import topics
from interfaces.service import enclave, middleware
from tests.promises.marks import BABBLER, GARBAGE, TEXT, nan

RATES = {
    "flood": 10_000.0,
    "babble": 200.0,
    "pretend": 2.0,
    "foretell": 2.0,
}  # Hz; of babble, over all topics
PRETENDED_AGE = 1.2  # s of a presence: too old for `turn_on`, young enough to leave the engines on
FORETOLD = 0.2  # s by which a presence comes from the future: four times the tolerance of A3

_INVALID_STAMPS = (Time(sec=0), Time(sec=2**31 - 1))  # of a presence: too old, and in the future


def nonsense(topic: topics.Topic, rng: random.Random) -> bytes:
    """Return a serialized message that no reader of the topic may accept."""
    message = _bad_message(topic, rng) if rng.random() < 0.5 else None
    if message is not None:
        return bytes(serialize_message(message))
    # DDS checks the header. The rest is too short for a number, even padded to 4 bytes.
    tail = b"" if topic.type is Float64 else rng.randbytes(rng.randrange(64))
    return b"\x00\x01\x00\x00" + GARBAGE + tail


def _bad_message(topic: topics.Topic, rng: random.Random) -> Any:
    """Return a readable message with bad content; ``None`` for a type without one."""
    if topic.type is PointStamped:
        return PointStamped(header=Header(frame_id=TEXT), point=Point(x=nan(topic), y=rng.random()))
    if topic.type is Header:
        return Header(stamp=rng.choice(_INVALID_STAMPS), frame_id=TEXT)
    if topic.type is TimeReference:
        return TimeReference(time_ref=Time(sec=-1), source=TEXT)
    contents = {Bool: False, Float64: nan(topic), String: TEXT}
    return topic.type(data=contents[topic.type]) if topic.type in contents else None


def flood(node: Node, rate: float) -> None:
    """Send heartbeats much faster than any switch, at a rate [Hz]."""
    topic = topics.OPERATOR_HEARTBEAT
    publisher = node.create_publisher(topic.type, topic.name, topic.qos)
    heartbeat = serialize_message(Bool(data=True))  # once: the arm needs the processor
    for _ in _ticks(rate):
        publisher.publish(heartbeat)


def babble(node: Node, rate: float) -> None:
    """Send nonsense on every topic, at a rate [Hz]."""
    rng = random.Random(1)
    publishers = [
        (topic, node.create_publisher(topic.type, topic.name, topic.qos)) for topic in topics.CONTRACT
    ]
    for _ in _ticks(rate):
        topic, publisher = rng.choice(publishers)
        with suppress(RuntimeError):  # Fast DDS sends nothing that is longer than its type
            publisher.publish(nonsense(topic, rng))


def pretend(node: Node, rate: float, age: float = PRETENDED_AGE) -> None:
    """Report at a rate [Hz] that the operator was seen so long ago [s]."""
    topic = topics.OPERATOR_PRESENCE
    publisher = node.create_publisher(topic.type, topic.name, topic.qos)
    for _ in _ticks(rate):
        sec, nanosec = divmod(time.time_ns() - int(age * 1e9), 10**9)
        publisher.publish(Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=TEXT))


def foretell(node: Node, rate: float) -> None:
    """Report at a rate [Hz] that the operator will be seen in 0.2 s."""
    pretend(node, rate, -FORETOLD)


def _ticks(rate: float) -> Iterator[None]:
    """Yield at an average rate [Hz]."""
    begin, count = time.monotonic(), 0
    while rclpy.ok():
        while count < (time.monotonic() - begin) * rate:
            count += 1
            yield
        time.sleep(1 / min(rate, 1000))


def run(mode: str, rate: float) -> None:
    """Flood, babble or pretend at a rate [Hz] until killed."""
    with middleware.without_shared_memory():
        namespace = namespace_of(os.environ)
        rclpy.init(
            args=[*middleware.WITHOUT_LOG_FILES, *enclave.arguments(BABBLER, namespace)],
            signal_handler_options=SignalHandlerOptions.NO,
        )  # a signal ends it without clean-up
        node = Node(f"{BABBLER}_{os.getpid()}", namespace=namespace)
    modes = {"flood": flood, "babble": babble, "pretend": pretend, "foretell": foretell}
    modes[mode](node, rate)


if __name__ == "__main__":
    run(sys.argv[1], RATES[sys.argv[1]])
