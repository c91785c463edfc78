from __future__ import annotations

from typing import Any

import reactivex as rx
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, QoSProfile
from reactivex import operators as ops
from reactivex.subject import Subject
from std_msgs.msg import String

from reactive_node import ReactiveNode
from reactive_node.testing import SpinUntil


def test_missed_deadline_is_event(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    qos = QoSProfile(depth=1, deadline=Duration(seconds=0.1))
    missed: list[int] = []
    events = node.create_event_observable(String, "topic", qos, "deadline")
    subscription = events.subscribe(lambda info: missed.append(info.total_count))

    publisher = peer.create_publisher(String, "topic", qos)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(String(data="once"))
    spin_until(lambda: missed[-1:] >= [1])
    subscription.dispose()
    spin_until(lambda: publisher.get_subscription_count() == 0)


def test_lost_liveliness_is_event(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    qos = QoSProfile(
        depth=1,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=0.2),
    )
    alive: list[int] = []
    events = node.create_event_observable(String, "topic", qos, "liveliness")
    events.subscribe(lambda info: alive.append(info.alive_count))

    publisher = peer.create_publisher(String, "topic", qos)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    # Asserted until the event arrives: its count is that of the moment of the callback.
    spin_until(lambda: publisher.assert_liveliness() or alive[-1:] == [1])
    spin_until(lambda: alive[-1:] == [0])


def test_reader_of_events_deserializes_no_message(node: ReactiveNode) -> None:
    node.create_event_observable(String, "topic", 10, "matched").subscribe()
    (reader,) = (each for each in node.subscriptions if each.topic_name == "/topic")
    assert reader.raw


def test_subject_makes_observable_of_publisher_events(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    qos = QoSProfile(depth=1, deadline=Duration(seconds=0.1))
    missed, matched = Subject[Any](), Subject[Any]()
    events: list[str] = []
    missed.pipe(ops.take(1)).subscribe(lambda _: events.append("missed"))
    matched.pipe(ops.take(1)).subscribe(lambda info: events.append(f"matched {info.current_count}"))
    callbacks = PublisherEventCallbacks(deadline=missed.on_next, matched=matched.on_next)
    node.publish_observable(rx.just(String(data="once")), String, "topic", qos, event_callbacks=callbacks)

    peer.create_subscription(String, "topic", lambda _: None, qos)

    spin_until(lambda: sorted(events) == ["matched 1", "missed"])
