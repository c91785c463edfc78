from __future__ import annotations

from typing import Any

import pytest
from deploy.ground.tests.nodes import SpinUntil
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import (
    PublisherEventCallbacks,
    QoSLivelinessChangedInfo,
    QoSOfferedIncompatibleQoSInfo,
    QoSPublisherMatchedInfo,
    QoSRequestedIncompatibleQoSInfo,
    QoSSubscriptionMatchedInfo,
    SubscriptionEventCallbacks,
)
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    LivelinessPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from std_msgs.msg import Bool, Float64

# rclpy 7.1.3 itself uses the class that it deprecates.
pytestmark = pytest.mark.filterwarnings("ignore:QoSEventHandler is deprecated")


def ignore(message: Float64) -> None:
    """A subscription's callback for tests that need no messages."""


def counts(info: QoSPublisherMatchedInfo | QoSSubscriptionMatchedInfo) -> tuple[int, int, int, int]:
    return info.total_count, info.total_count_change, info.current_count, info.current_count_change


def test_both_sides_get_events_of_matching_and_unmatching(node: Node, spin_until: SpinUntil) -> None:
    offered: list[QoSPublisherMatchedInfo] = []
    requested: list[QoSSubscriptionMatchedInfo] = []
    publisher = node.create_publisher(
        Float64, "x", 1, event_callbacks=PublisherEventCallbacks(matched=offered.append)
    )
    subscription = node.create_subscription(
        Float64, "x", ignore, 1, event_callbacks=SubscriptionEventCallbacks(matched=requested.append)
    )
    spin_until(lambda: offered and requested)
    assert [counts(info) for info in (*offered, *requested)] == [(1, 1, 1, 1)] * 2
    node.destroy_subscription(subscription)
    spin_until(lambda: len(offered) == 2)
    assert counts(offered[1]) == (1, 0, 0, -1)
    node.destroy_publisher(publisher)


def test_both_sides_get_events_of_incompatible_qos(node: Node, spin_until: SpinUntil) -> None:
    heard: list[Any] = []
    node.create_publisher(
        Float64, "x", 1, event_callbacks=PublisherEventCallbacks(incompatible_qos=heard.append)
    )
    node.create_subscription(
        Float64,
        "x",
        ignore,
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=heard.append),
    )
    spin_until(lambda: len(heard) == 2)
    assert {type(info) for info in heard} == {
        QoSOfferedIncompatibleQoSInfo,
        QoSRequestedIncompatibleQoSInfo,
    }
    assert [(info.total_count, info.last_policy_kind) for info in heard] == [
        (1, QoSPolicyKind.DURABILITY)
    ] * 2


def test_incompatible_qos_is_logged_with_the_text_of_rclpy(
    node: Node, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str]
) -> None:
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_publisher(Float64, "x", best_effort)
    node.create_subscription(Float64, "x", ignore, 1)
    text = ""

    def logged() -> bool:
        nonlocal text
        text += capfd.readouterr().err
        return text.count("Last incompatible policy") == 2

    spin_until(logged)
    for sentence in (
        "New publisher discovered on topic 'x', offering incompatible QoS. No messages will be received "
        "from it. Last incompatible policy: RELIABILITY",
        "New subscription discovered on topic 'x', requesting incompatible QoS. No messages will be sent "
        "to it. Last incompatible policy: RELIABILITY",
    ):
        assert f"[node]: {sentence}" in text
    quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
    subscription = node.create_subscription(Float64, "x", ignore, 1, event_callbacks=quiet)
    assert subscription.event_handlers == []


def test_both_sides_get_events_of_a_missed_deadline(node: Node, spin_until: SpinUntil) -> None:
    profile = QoSProfile(depth=1, deadline=Duration(seconds=0.05))
    offered: list[Any] = []
    requested: list[Any] = []
    publisher = node.create_publisher(
        Float64, "x", profile, event_callbacks=PublisherEventCallbacks(deadline=offered.append)
    )
    node.create_subscription(
        Float64, "x", ignore, profile, event_callbacks=SubscriptionEventCallbacks(deadline=requested.append)
    )
    spin_until(publisher.get_subscription_count)
    publisher.publish(Float64())
    spin_until(lambda: offered and requested)
    assert offered[0].total_count >= 1
    assert requested[0].total_count >= 1


def test_a_publisher_that_stops_asserting_loses_its_liveliness(node: Node, spin_until: SpinUntil) -> None:
    profile = QoSProfile(
        depth=1,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=0.2),
    )
    lost: list[Any] = []
    changed: list[QoSLivelinessChangedInfo] = []
    publisher = node.create_publisher(
        Float64, "x", profile, event_callbacks=PublisherEventCallbacks(liveliness=lost.append)
    )
    node.create_subscription(
        Float64, "x", ignore, profile, event_callbacks=SubscriptionEventCallbacks(liveliness=changed.append)
    )
    spin_until(publisher.get_subscription_count)
    publisher.publish(Float64())
    spin_until(lambda: lost and any(info.not_alive_count for info in changed))
    count = len(changed)
    # Publish repeatedly: an event carries the state at its delivery, and the lease lasts only 0.2 s.
    spin_until(lambda: publisher.publish(Float64()) or any(info.alive_count for info in changed[count:]))


def test_a_message_is_not_delivered_after_its_lifespan(node: Node, spin_until: SpinUntil) -> None:
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    short = QoSProfile(
        depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=Duration(nanoseconds=1000)
    )
    node.create_publisher(Float64, "x", short).publish(Float64(data=1.0))
    node.create_publisher(Float64, "x", latched).publish(Float64(data=2.0))

    def kept() -> list[float]:
        received: list[float] = []
        subscription = node.create_subscription(
            Float64, "x", lambda message: received.append(message.data), latched
        )
        spin_until(lambda: 2.0 in received)
        node.destroy_subscription(subscription)
        return received

    spin_until(lambda: kept() == [2.0])


def test_incompatible_type_callbacks_do_not_prevent_other_events(
    node: Node, other_context: Context, spin_until: SpinUntil
) -> None:
    heard: list[Any] = []
    offering = PublisherEventCallbacks(incompatible_type=heard.append, matched=heard.append)
    requesting = SubscriptionEventCallbacks(incompatible_type=heard.append, matched=heard.append)
    node.create_publisher(Float64, "x", 1, event_callbacks=offering)
    other = Node("other", context=other_context)  # in one participant, Fast DDS refuses a second type
    other.create_publisher(Bool, "x", 1)
    node.create_subscription(Float64, "x", ignore, 1, event_callbacks=requesting)
    spin_until(lambda: len(heard) == 2)
    other.destroy_node()
    assert {type(info) for info in heard} == {QoSPublisherMatchedInfo, QoSSubscriptionMatchedInfo}
