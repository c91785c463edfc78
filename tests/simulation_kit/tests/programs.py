"""A talker and a listener that note what DDS does: they run for real and simulated, and must note the same.

``python -m tests.simulation_kit.tests.programs talker`` (or ``listener``) runs one of them.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Empty, Int64

DEADLINE = 0.1  # s
LEASE = 0.2  # s
LIFESPAN = 0.1  # s
NAP = 0.4  # s

_LATCHED = DurabilityPolicy.TRANSIENT_LOCAL
_BEST_EFFORT = ReliabilityPolicy.BEST_EFFORT
_MANUAL = LivelinessPolicy.MANUAL_BY_TOPIC
PROFILES: dict[str, tuple[QoSProfile, QoSProfile]] = {
    "history": (QoSProfile(depth=3, durability=_LATCHED), QoSProfile(depth=10, durability=_LATCHED)),
    "history_best_effort": (
        QoSProfile(depth=3, durability=_LATCHED),
        QoSProfile(depth=10, durability=_LATCHED, reliability=_BEST_EFFORT),
    ),
    "history_expired": (
        QoSProfile(depth=3, durability=_LATCHED, lifespan=Duration(seconds=LIFESPAN)),
        QoSProfile(depth=10, durability=_LATCHED),
    ),
    "volatile": (QoSProfile(depth=10), QoSProfile(depth=10)),
    "order": (QoSProfile(depth=100), QoSProfile(depth=100)),
    "overflow": (QoSProfile(depth=10), QoSProfile(depth=2)),
    "short_life": (QoSProfile(depth=10, lifespan=Duration(seconds=LIFESPAN)), QoSProfile(depth=10)),
    "deadline": (
        QoSProfile(depth=1, deadline=Duration(seconds=DEADLINE)),
        QoSProfile(depth=1, deadline=Duration(seconds=DEADLINE)),
    ),
    "manual": (
        QoSProfile(depth=1, liveliness=_MANUAL, liveliness_lease_duration=Duration(seconds=LEASE)),
        QoSProfile(depth=1, liveliness=_MANUAL, liveliness_lease_duration=Duration(seconds=LEASE)),
    ),
    "too_unreliable": (QoSProfile(depth=1, reliability=_BEST_EFFORT), QoSProfile(depth=1)),
    "too_volatile": (QoSProfile(depth=1), QoSProfile(depth=1, durability=_LATCHED)),
    "too_slow": (
        QoSProfile(depth=1, deadline=Duration(seconds=2)),
        QoSProfile(depth=1, deadline=Duration(seconds=1)),
    ),
    "too_automatic": (QoSProfile(depth=1), QoSProfile(depth=1, liveliness=_MANUAL)),
    "too_long_lease": (
        QoSProfile(depth=1, liveliness_lease_duration=Duration(seconds=2)),
        QoSProfile(depth=1, liveliness_lease_duration=Duration(seconds=1)),
    ),
}
"""The offered and the requested QoS of each topic."""
EARLY = ("history", "history_best_effort", "history_expired", "volatile")


def _spin_until(node: Node, condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 20.0
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError(f"{node.get_name()} has waited too long")
        rclpy.spin_once(node, timeout_sec=0.5)


def _spin_for(node: Node, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while (left := deadline - time.monotonic()) > 0:
        rclpy.spin_once(node, timeout_sec=left)


def talker() -> None:
    rclpy.init()
    node = Node("talker")
    note: dict[str, Any] = {"incompatible": {}}
    events = {
        topic: PublisherEventCallbacks(
            incompatible_qos=lambda info, topic=topic: note["incompatible"].update(
                {topic: info.last_policy_kind.name.removeprefix("RMW_QOS_POLICY_")}
            ),
            deadline=lambda info: note.update(deadlines=info.total_count),
            liveliness=lambda info: note.update(lost=info.total_count),
        )
        for topic in PROFILES
    }
    publishers = {
        topic: node.create_publisher(Int64, topic, offered, event_callbacks=events[topic])
        for topic, (offered, _) in PROFILES.items()
    }
    nap = node.create_publisher(Empty, "nap", 1)
    ready: list[Empty] = []
    node.create_subscription(Empty, "ready", ready.append, QoSProfile(depth=1, durability=_LATCHED))

    missed: list[int] = []
    alive: list[int] = []
    naps: list[Empty] = []
    node.create_subscription(Empty, "napping", naps.append, 1)
    node.create_subscription(Int64, "missed", lambda message: missed.append(message.data), 10)
    node.create_subscription(Int64, "alive", lambda message: alive.append(message.data), 10)

    def publish(topic: str, *numbers: int) -> None:
        for number in numbers:
            publishers[topic].publish(Int64(data=number))

    for topic in EARLY:
        publish(topic, 1, 2, 3, 4, 5)
    time.sleep(2 * LIFESPAN)  # what expires is gone before the listener starts, on a fast machine too
    print("early", flush=True)
    _spin_until(node, lambda: ready and all(publishers[each].get_subscription_count() for each in EARLY))
    publish("volatile", 6)
    publish("order", *range(100))
    publish("deadline", 1)
    _spin_until(node, lambda: missed and missed[-1] >= 3)
    publish("deadline", 2)
    _spin_until(node, lambda: alive[-1:] == [0])
    note["lost_before_assertion"] = note["lost"]
    publishers["manual"].assert_liveliness()
    _spin_for(node, LEASE / 4)
    publish("manual", 1)
    _spin_until(node, lambda: alive[-1:] == [1])
    _spin_until(node, lambda: alive[-1:] == [0])
    nap.publish(Empty())
    _spin_until(node, lambda: naps)
    publish("short_life", 1)
    publish("overflow", 1, 2, 3, 4, 5)
    _spin_for(node, NAP)
    print(json.dumps(note), flush=True)
    rclpy.shutdown()


def listener() -> None:
    rclpy.init()
    node = Node("listener")
    received: dict[str, list[int]] = {topic: [] for topic in PROFILES}
    note: dict[str, Any] = {"received": received, "incompatible": {}, "alive": [], "matched": [], "lost": 0}
    note["deadlines"] = 0
    missed = node.create_publisher(Int64, "missed", 10)
    alive = node.create_publisher(Int64, "alive", 10)

    def on_message(topic: str, message: Int64) -> None:
        received[topic].append(message.data)
        if topic == "deadline":
            note[f"deadlines_before_{message.data}"] = note["deadlines"]

    def on_deadline(info: Any) -> None:
        note["deadlines"] = info.total_count
        missed.publish(Int64(data=info.total_count))

    def on_liveliness(topic: str, info: Any) -> None:
        if topic == "manual":
            note["alive"].append([info.alive_count, info.not_alive_count])
            alive.publish(Int64(data=info.alive_count))

    def events(topic: str) -> SubscriptionEventCallbacks:
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda info: note["incompatible"].update(
                {topic: info.last_policy_kind.name.removeprefix("RMW_QOS_POLICY_")}
            ),
            deadline=on_deadline,
            liveliness=lambda info: on_liveliness(topic, info),
            matched=lambda info: note["matched"].append(info.current_count) if topic == "order" else None,
            message_lost=lambda info: note.update(lost=info.total_count),
        )

    for topic, (_, requested) in PROFILES.items():
        node.create_subscription(
            Int64,
            topic,
            lambda message, topic=topic: on_message(topic, message),
            requested,
            event_callbacks=events(topic),
        )
    napping = node.create_publisher(Empty, "napping", 1)

    def nap(_: Empty) -> None:
        napping.publish(Empty())
        time.sleep(NAP)

    node.create_subscription(Empty, "nap", nap, 1)
    compatible = [topic for topic in PROFILES if not topic.startswith("too_")]
    _spin_until(node, lambda: all(node.count_publishers(topic) for topic in compatible))
    _spin_for(node, 0.3)
    ready = node.create_publisher(Empty, "ready", QoSProfile(depth=1, durability=_LATCHED))
    ready.publish(Empty())
    _spin_until(node, lambda: note["matched"][-1:] == [0])
    print(json.dumps(note), flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    {"talker": talker, "listener": listener}[sys.argv[1]]()
