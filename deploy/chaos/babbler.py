"""Publishers that speak too much, or nonsense. ::

python -m deploy.chaos.babbler flood     10,000 heartbeats a second
python -m deploy.chaos.babbler babble    NaN and random bytes, on every topic
"""

from __future__ import annotations

import os
import random
import sys
import time
from collections.abc import Iterator
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Bool, Float64, Header, String

from deploy.chaos.marks import GARBAGE, TEXT, nan
from interfaces import topics

RATE = 10_000  # Hz, of a flood
BABBLE = 200  # Hz, over all topics
_FRESH = (Time(sec=0), Time(sec=2**31 - 1))  # of a presence that counts for nothing: long ago, and to come


def nonsense(topic: topics.Topic, rng: random.Random) -> Any:
    """A message, or serialized bytes, that no reader of the topic may take for good."""
    if rng.random() < 0.5:
        # DDS checks the header. What follows is too short for a number, also when it is padded to 4 bytes.
        tail = b"" if topic.type is Float64 else rng.randbytes(rng.randrange(64))
        return b"\x00\x01\x00\x00" + GARBAGE + tail
    if topic is topics.EFFECTOR_POSITION:
        return PointStamped(header=Header(frame_id=TEXT), point=Point(x=nan(topic), y=rng.random()))
    if topic is topics.OPERATOR_PRESENCE:
        return Header(stamp=rng.choice(_FRESH), frame_id=TEXT)
    if topic is topics.OPERATOR_HEARTBEAT:
        return Bool(data=False)
    if topic is topics.DIAGNOSTICS:
        return topic.type()
    return topic.type(data=TEXT if topic.type is String else nan(topic))


def flood(node: Node) -> None:
    """Heartbeats, as fast as nobody presses."""
    topic = topics.OPERATOR_HEARTBEAT
    publisher = node.create_publisher(topic.type, topic.name, topic.qos)
    for _ in _ticks(RATE):
        publisher.publish(Bool(data=True))


def babble(node: Node) -> None:
    """Nonsense on every topic."""
    rng = random.Random(1)
    publishers = {
        topic.name: node.create_publisher(topic.type, topic.name, topic.qos) for topic in topics.CONTRACT
    }
    for _ in _ticks(BABBLE):
        topic = rng.choice(topics.CONTRACT)
        message = nonsense(topic, rng)
        publishers[topic.name].publish(message if isinstance(message, bytes) else serialize_message(message))


def _ticks(rate: float) -> Iterator[None]:
    """So many a second, on the average."""
    begin, count = time.monotonic(), 0
    while rclpy.ok():
        while count < (time.monotonic() - begin) * rate:
            count += 1
            yield
        time.sleep(1 / min(rate, 1000))


def main(arguments: list[str]) -> None:
    """Speak until killed."""
    namespace = os.environ.get("ARM_NAMESPACE", "/")
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)  # no signal is worth a last word
    node = Node(f"babbler_{os.getpid()}", namespace=namespace)
    {"flood": flood, "babble": babble}[arguments[0]](node)


if __name__ == "__main__":
    main(sys.argv[1:])
