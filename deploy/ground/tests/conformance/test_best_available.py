from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from deploy.ground.tests.conformance.middleware import announced_history
from deploy.ground.tests.nodes import Call, SpinUntil
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

Create = Callable[..., QoSProfile]

BEST_EFFORT, RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
VOLATILE, LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
AUTOMATIC, MANUAL = LivelinessPolicy.AUTOMATIC, LivelinessPolicy.MANUAL_BY_TOPIC
SECOND, HOUR = Duration(seconds=1), Duration(seconds=3600)


@pytest.fixture
def create(node: Node, spin_until: SpinUntil) -> Create:
    """Creates an endpoint of ``x``; returns its QoS as the graph reports it."""

    def qos_of(kind: str, **options: Any) -> QoSProfile:
        endpoints_of = (
            node.get_publishers_info_by_topic if kind == "publisher" else node.get_subscriptions_info_by_topic
        )
        before = [info.endpoint_gid for info in endpoints_of("x")]
        qos = options.pop("qos", None) or QoSProfile(depth=1, **options)
        if kind == "publisher":
            node.create_publisher(Float64, "x", qos)
        else:
            node.create_subscription(Float64, "x", lambda message: None, qos)
        spin_until(lambda: len(endpoints_of("x")) > len(before))
        (new,) = (info for info in endpoints_of("x") if info.endpoint_gid not in before)
        return new.qos_profile

    return qos_of


def policies(qos: QoSProfile) -> tuple[object, ...]:
    """The policies that may be best available."""
    return (qos.reliability, qos.durability, qos.liveliness, qos.deadline, qos.liveliness_lease_duration)


def requested(create: Create) -> tuple[object, ...]:
    return policies(create("subscription", qos=qos_profile_best_available))


def offered(create: Create) -> tuple[object, ...]:
    return policies(create("publisher", qos=qos_profile_best_available))


@pytest.mark.parametrize("reliability", [RELIABLE, BEST_EFFORT])
@pytest.mark.parametrize("durability", [VOLATILE, LATCHED])
def test_a_subscription_matches_an_ordinary_publisher_at_its_best(
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
    # earlier samples are sent again only to reliable readers
    gets_earlier_samples = (reliability, durability) == (RELIABLE, LATCHED)
    if gets_earlier_samples:
        spin_until(lambda: received == [1.0])
    publisher.publish(Float64(data=2.0))
    spin_until(lambda: received[-1:] == [2.0])
    assert received == ([1.0, 2.0] if gets_earlier_samples else [2.0])


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


def test_a_subscription_requests_only_what_all_publishers_offer(create: Create) -> None:
    create(
        "publisher", liveliness=MANUAL, deadline=SECOND, liveliness_lease_duration=HOUR, durability=LATCHED
    )
    assert requested(create) == (RELIABLE, LATCHED, MANUAL, SECOND, HOUR)
    create("publisher", liveliness=AUTOMATIC, deadline=HOUR, liveliness_lease_duration=SECOND)
    assert requested(create) == (RELIABLE, VOLATILE, AUTOMATIC, HOUR, HOUR)
    create("publisher", reliability=BEST_EFFORT, durability=LATCHED)
    assert requested(create) == (BEST_EFFORT, VOLATILE, AUTOMATIC, Infinite, Infinite)


def test_a_publisher_offers_enough_for_every_subscription(create: Create) -> None:
    create("subscription", reliability=BEST_EFFORT, deadline=HOUR, liveliness_lease_duration=SECOND)
    assert offered(create) == (RELIABLE, LATCHED, AUTOMATIC, HOUR, SECOND)
    create("subscription", liveliness=MANUAL, deadline=SECOND, liveliness_lease_duration=HOUR)
    assert offered(create) == (RELIABLE, LATCHED, MANUAL, SECOND, SECOND)


def test_without_publishers_a_subscription_requests_the_highest_level(create: Create) -> None:
    """As in rmw_dds_common: such a subscription matches no ordinary publisher that comes later."""
    assert requested(create) == (RELIABLE, LATCHED, MANUAL, Infinite, Infinite)


def test_only_best_available_policies_are_chosen(create: Create) -> None:
    create("publisher", durability=LATCHED, deadline=SECOND)
    qos = QoSProfile(depth=3, durability=DurabilityPolicy.BEST_AVAILABLE, deadline=HOUR)
    chosen = create("subscription", qos=qos)
    assert policies(chosen) == (RELIABLE, LATCHED, AUTOMATIC, HOUR, Infinite)
    assert (chosen.history, chosen.depth) == announced_history(3)


def test_services_with_best_available_qos_use_the_services_default(
    node: Node, spin_until: SpinUntil, call: Call
) -> None:
    best = qos_profile_best_available
    node.create_service(Trigger, "serve", lambda request, response: response, qos_profile=best)
    node.create_client(Trigger, "serve", qos_profile=best)
    for endpoints_of in (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic):
        spin_until(lambda: endpoints_of("rq/serveRequest", no_mangle=True))  # noqa: B023
        (info,) = endpoints_of("rq/serveRequest", no_mangle=True)
        assert policies(info.qos_profile) == (RELIABLE, VOLATILE, AUTOMATIC, Infinite, Infinite)
    assert call(Trigger, "serve") == Trigger.Response()


@pytest.mark.parametrize("policy", ["history", "reliability", "durability", "liveliness"])
def test_an_unknown_policy_creates_nothing(node: Node, policy: str) -> None:
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
