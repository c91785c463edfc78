"""Profiles that leave policies to what is there: best available, and those that say nothing at all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rclpy.duration import Duration, Infinite
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_best_available,
    qos_profile_unknown,
)
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

SpinUntil = Callable[..., None]
Created = Callable[..., QoSProfile]

BEST_EFFORT, RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
VOLATILE, LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
AUTOMATIC, MANUAL = LivelinessPolicy.AUTOMATIC, LivelinessPolicy.MANUAL_BY_TOPIC
SECOND, HOUR = Duration(seconds=1), Duration(seconds=3600)


@pytest.fixture
def created(node: Node, spin_until: SpinUntil) -> Created:
    """Creates an endpoint of ``x``, and returns the QoS that the graph tells of it, which takes time."""

    def qos_of(kind: str, **options: Any) -> QoSProfile:
        asked = (
            node.get_publishers_info_by_topic if kind == "publisher" else node.get_subscriptions_info_by_topic
        )
        before = [info.endpoint_gid for info in asked("x")]
        qos = options.pop("qos", None) or QoSProfile(depth=1, **options)
        if kind == "publisher":
            node.create_publisher(Float64, "x", qos)
        else:
            node.create_subscription(Float64, "x", lambda message: None, qos)
        spin_until(lambda: len(asked("x")) > len(before))
        (new,) = (info for info in asked("x") if info.endpoint_gid not in before)
        return new.qos_profile

    return qos_of


def policies(qos: QoSProfile) -> tuple[object, ...]:
    """What can be best available."""
    return (qos.reliability, qos.durability, qos.liveliness, qos.deadline, qos.liveliness_lease_duration)


def requested(created: Created) -> tuple[object, ...]:
    """What a best available subscription to ``x`` requests."""
    return policies(created("subscription", qos=qos_profile_best_available))


def offered(created: Created) -> tuple[object, ...]:
    """What a best available publisher on ``x`` offers."""
    return policies(created("publisher", qos=qos_profile_best_available))


@pytest.mark.parametrize("reliability", [RELIABLE, BEST_EFFORT])
@pytest.mark.parametrize("durability", [VOLATILE, LATCHED])
def test_a_subscription_hears_an_ordinary_publisher_at_its_best(
    node: Node, spin_until: SpinUntil, reliability: ReliabilityPolicy, durability: DurabilityPolicy
) -> None:
    received: list[float] = []
    profile = QoSProfile(depth=1, reliability=reliability, durability=durability)
    publisher = node.create_publisher(Float64, "x", profile)
    publisher.publish(Float64(data=1.0))
    spin_until(lambda: node.get_publishers_info_by_topic("x"))
    subscription = node.create_subscription(
        Float64, "x", lambda message: received.append(message.data), qos_profile_best_available
    )
    spin_until(lambda: node.get_subscriptions_info_by_topic("x"))
    (info,) = node.get_subscriptions_info_by_topic("x")
    assert policies(info.qos_profile) == (reliability, durability, AUTOMATIC, Infinite, Infinite)
    assert subscription.qos_profile is qos_profile_best_available
    spin_until(publisher.get_subscription_count)
    # what was published before is sent again, so only reliably
    hears_the_past = (reliability, durability) == (RELIABLE, LATCHED)
    if hears_the_past:
        spin_until(lambda: received == [1.0])
    publisher.publish(Float64(data=2.0))
    spin_until(lambda: received[-1:] == [2.0])
    assert received == ([1.0, 2.0] if hears_the_past else [2.0])


@pytest.mark.parametrize("reliability", [RELIABLE, BEST_EFFORT])
@pytest.mark.parametrize("durability", [VOLATILE, LATCHED])
def test_a_publisher_reaches_every_ordinary_subscription(
    node: Node, spin_until: SpinUntil, reliability: ReliabilityPolicy, durability: DurabilityPolicy
) -> None:
    received: list[Float64] = []
    profile = QoSProfile(depth=1, reliability=reliability, durability=durability)
    node.create_subscription(Float64, "x", received.append, profile)
    spin_until(lambda: node.get_subscriptions_info_by_topic("x"))
    publisher = node.create_publisher(Float64, "x", qos_profile_best_available)
    spin_until(lambda: node.get_publishers_info_by_topic("x"))
    (info,) = node.get_publishers_info_by_topic("x")
    assert policies(info.qos_profile) == (RELIABLE, LATCHED, AUTOMATIC, Infinite, Infinite)
    spin_until(publisher.get_subscription_count)
    publisher.publish(Float64(data=1.0))
    spin_until(lambda: received)


def test_a_subscription_requests_what_all_publishers_offer(created: Created) -> None:
    created(
        "publisher", liveliness=MANUAL, deadline=SECOND, liveliness_lease_duration=HOUR, durability=LATCHED
    )
    assert requested(created) == (RELIABLE, LATCHED, MANUAL, SECOND, HOUR)
    created("publisher", liveliness=AUTOMATIC, deadline=HOUR, liveliness_lease_duration=SECOND)
    assert requested(created) == (RELIABLE, VOLATILE, AUTOMATIC, HOUR, HOUR)
    created("publisher", reliability=BEST_EFFORT, durability=LATCHED)
    assert requested(created) == (BEST_EFFORT, VOLATILE, AUTOMATIC, Infinite, Infinite)


def test_a_publisher_offers_what_any_subscription_requests(created: Created) -> None:
    created("subscription", reliability=BEST_EFFORT, deadline=HOUR, liveliness_lease_duration=SECOND)
    assert offered(created) == (RELIABLE, LATCHED, AUTOMATIC, HOUR, SECOND)
    created("subscription", liveliness=MANUAL, deadline=SECOND, liveliness_lease_duration=HOUR)
    assert offered(created) == (RELIABLE, LATCHED, MANUAL, SECOND, SECOND)


def test_where_nobody_is_yet_the_highest_level_of_service_is_the_best(created: Created) -> None:
    """So decides rmw_dds_common, too: such a subscription matches no ordinary publisher that comes later."""
    assert requested(created) == (RELIABLE, LATCHED, MANUAL, Infinite, Infinite)


def test_only_what_is_said_to_be_best_available_is_chosen(created: Created) -> None:
    created("publisher", durability=LATCHED, deadline=SECOND)
    qos = QoSProfile(depth=3, durability=DurabilityPolicy.BEST_AVAILABLE, deadline=HOUR)
    chosen = created("subscription", qos=qos)
    assert policies(chosen) == (RELIABLE, LATCHED, AUTOMATIC, HOUR, Infinite)
    assert chosen.depth == 3


def test_for_a_service_the_default_of_services_is_the_best(node: Node, spin_until: SpinUntil) -> None:
    best = qos_profile_best_available
    node.create_service(Trigger, "serve", lambda request, response: response, qos_profile=best)
    client = node.create_client(Trigger, "serve", qos_profile=best)
    for asked in (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic):
        spin_until(lambda: asked("rq/serveRequest", no_mangle=True))  # noqa: B023
        (info,) = asked("rq/serveRequest", no_mangle=True)
        assert policies(info.qos_profile) == (RELIABLE, VOLATILE, AUTOMATIC, Infinite, Infinite)
    spin_until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    spin_until(future.done)
    assert future.result() == Trigger.Response()


@pytest.mark.parametrize("policy", ["history", "reliability", "durability", "liveliness"])
def test_nothing_is_created_with_a_policy_that_is_unknown(node: Node, policy: str) -> None:
    qos = QoSProfile(depth=1)
    setattr(qos, policy, getattr(qos_profile_unknown, policy))
    creations: list[Callable[[], Any]] = [
        lambda: node.create_publisher(Float64, "x", qos),
        lambda: node.create_subscription(Float64, "x", lambda message: None, qos),
        lambda: node.create_service(Trigger, "serve", lambda request, response: response, qos_profile=qos),
        lambda: node.create_client(Trigger, "serve", qos_profile=qos),
    ]
    for create in creations:
        with pytest.raises(rclpy_implementation.RCLError):
            create()
    topics = dict(node.get_topic_names_and_types(no_demangle=True))
    assert not topics.keys() & {"rt/x", "rq/serveRequest", "rr/serveReply"}
