"""Nodes against the DDS of a second vendor, with bytes recorded from real ROS 2 nodes."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from deploy.runtime.tests.interop.conftest import FastPeer

import builtin_interfaces.msg
import diagnostic_msgs.msg
import geometry_msgs.msg
import std_msgs.msg
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool

pytestmark = pytest.mark.timeout(300)  # the first test builds the peer

SpinUntil = Callable[[Callable[[], object]], None]

GOLDEN = json.loads((Path(__file__).parents[1] / "facts" / "cdr_golden.json").read_text())
NAMES = ("float64_pi4", "bool_true", "string_utf8", "point_stamped", "diagnostics")
PACKAGES = {
    "std_msgs": std_msgs,
    "geometry_msgs": geometry_msgs,
    "diagnostic_msgs": diagnostic_msgs,
    "builtin_interfaces": builtin_interfaces,
}
FLOAT64 = "std_msgs::msg::dds_::Float64_"
DURABILITY, RELIABILITY = "2", "11"  # QosPolicyId_t


def golden(name: str) -> tuple[Any, str, bytes]:
    """A message, the DDS name of its type, and its bytes."""
    entry = GOLDEN[name]
    package, _, type_name = entry["type"].split("/")
    message = eval(entry["repr"], dict(PACKAGES))
    return message, f"{package}::msg::dds_::{type_name}_", bytes.fromhex(entry["cdr"])


def padded(data: bytes) -> bytes:
    """A sample on the wire: RTPS pads it to a multiple of four bytes."""
    return data + bytes(-len(data) % 4)


def value(data: float) -> tuple[std_msgs.msg.Float64, bytes]:
    """A Float64 and its bytes."""
    return std_msgs.msg.Float64(data=data), b"\0\1\0\0" + struct.pack("<d", data)


@pytest.mark.parametrize("name", NAMES)
def test_a_fast_dds_reader_gets_messages_of_a_node(
    name: str, peer: FastPeer, node: Node, spin_until: SpinUntil
) -> None:
    message, type_name, data = golden(name)
    publisher = node.create_publisher(type(message), "topic", 10)
    peer.create("reader", "rt/topic", type_name)
    spin_until(
        lambda: publisher.get_subscription_count() and peer.has_reported("matched", "reader", "rt/topic", "1")
    )
    publisher.publish(message)
    spin_until(lambda: peer.samples("rt/topic"))
    assert peer.samples("rt/topic") == [padded(data)]


@pytest.mark.parametrize("name", NAMES)
def test_a_node_gets_samples_of_a_fast_dds_writer(
    name: str, peer: FastPeer, node: Node, spin_until: SpinUntil
) -> None:
    message, type_name, data = golden(name)
    received: list[Any] = []
    subscription = node.create_subscription(type(message), "topic", received.append, 10)
    peer.create("writer", "rt/topic", type_name)
    spin_until(
        lambda: subscription.get_publisher_count() and peer.has_reported("matched", "writer", "rt/topic", "1")
    )
    peer.send("rt/topic", data)
    spin_until(lambda: received)
    assert received == [message]


def test_a_late_fast_dds_reader_gets_the_latched_sample_of_a_node(
    peer: FastPeer, node: Node, spin_until: SpinUntil
) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(std_msgs.msg.Float64, "topic", latched)
    publisher.publish(value(1.0)[0])
    publisher.publish(value(2.0)[0])
    peer.create("reader", "rt/topic", FLOAT64, durability="transient_local")
    spin_until(lambda: peer.samples("rt/topic"))
    assert peer.samples("rt/topic") == [value(2.0)[1]]


def test_a_late_node_gets_the_latched_samples_of_a_fast_dds_writer(
    peer: FastPeer, node: Node, spin_until: SpinUntil
) -> None:
    peer.create("writer", "rt/topic", FLOAT64, durability="transient_local")
    for number in (1.0, 2.0, 3.0):
        peer.send("rt/topic", value(number)[1])
    spin_until(lambda: node.count_publishers("topic"))
    received: list[float] = []
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(
        std_msgs.msg.Float64, "topic", lambda message: received.append(message.data), latched
    )
    spin_until(lambda: len(received) >= 3)
    assert received == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("offered", "kind", "policy"),
    [
        (
            QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
            QoSPolicyKind.RELIABILITY,
            RELIABILITY,
        ),
        (QoSProfile(depth=1), QoSPolicyKind.DURABILITY, DURABILITY),
    ],
)
def test_both_sides_report_a_node_that_offers_too_little(
    offered: QoSProfile,
    kind: QoSPolicyKind,
    policy: str,
    peer: FastPeer,
    node: Node,
    spin_until: SpinUntil,
) -> None:
    events: list[Any] = []
    callbacks = PublisherEventCallbacks(incompatible_qos=events.append)
    publisher = node.create_publisher(std_msgs.msg.Float64, "topic", offered, event_callbacks=callbacks)
    durability = "transient_local" if kind == QoSPolicyKind.DURABILITY else "volatile"
    peer.create("reader", "rt/topic", FLOAT64, durability=durability)
    spin_until(lambda: events and peer.has_reported("incompatible", "reader", "rt/topic", policy))
    assert QoSPolicyKind(events[0].last_policy_kind) == kind
    assert publisher.get_subscription_count() == 0


@pytest.mark.parametrize(
    ("requested", "kind", "policy"),
    [
        (QoSProfile(depth=1), QoSPolicyKind.RELIABILITY, RELIABILITY),
        (
            QoSProfile(
                depth=1,
                reliability=ReliabilityPolicy.BEST_EFFORT,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
            ),
            QoSPolicyKind.DURABILITY,
            DURABILITY,
        ),
    ],
)
def test_both_sides_report_a_node_that_requests_too_much(
    requested: QoSProfile,
    kind: QoSPolicyKind,
    policy: str,
    peer: FastPeer,
    node: Node,
    spin_until: SpinUntil,
) -> None:
    events: list[Any] = []
    callbacks = SubscriptionEventCallbacks(incompatible_qos=events.append)
    node.create_subscription(
        std_msgs.msg.Float64, "topic", lambda message: None, requested, event_callbacks=callbacks
    )
    peer.create("writer", "rt/topic", FLOAT64, reliability="best_effort")
    spin_until(lambda: events and peer.has_reported("incompatible", "writer", "rt/topic", policy))
    assert QoSPolicyKind(events[0].last_policy_kind) == kind


# Services as in rmw_cyclonedds_cpp: one topic in each direction. A sample begins with the client's identity
# and a sequence number; USER_DATA pairs a reader with its writer.
HEADER = 16
SET_BOOL = "std_srvs::srv::dds_::SetBool"


def test_a_fast_dds_client_calls_a_service_of_a_node(
    peer: FastPeer, node: Node, spin_until: SpinUntil
) -> None:
    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success, response.message = request.data, "ok"
        return response

    node.create_service(SetBool, "switch", answer)
    peer.create("reader", "rr/switchReply", f"{SET_BOOL}_Response_", user_data="clientid=1.2.3;")
    peer.create("writer", "rq/switchRequest", f"{SET_BOOL}_Request_", user_data="clientid=1.2.3;")
    spin_until(
        lambda: (
            peer.has_reported("matched", "reader", "rr/switchReply", "1")
            and peer.has_reported("matched", "writer", "rq/switchRequest", "1")
        )
    )
    header = bytes(range(HEADER))

    def is_answered() -> bool:
        if peer.samples("rr/switchReply"):
            return True
        # Repeat the request: the node may not have discovered the peer's writer yet.
        peer.send("rq/switchRequest", b"\0\1\0\0" + header + b"\1")
        return False

    spin_until(is_answered)
    reply = b"\0\1\0\0" + header + b"\1\0\0\0" + b"\3\0\0\0ok\0"
    assert set(peer.samples("rr/switchReply")) == {padded(reply)}


def test_a_node_calls_a_service_of_a_fast_dds_server(
    peer: FastPeer, node: Node, spin_until: SpinUntil
) -> None:
    peer.create("reader", "rq/switchRequest", f"{SET_BOOL}_Request_", user_data="serviceid=4.5.6;")
    peer.create("writer", "rr/switchReply", f"{SET_BOOL}_Response_", user_data="serviceid=4.5.6;")
    client = node.create_client(SetBool, "switch")
    spin_until(
        lambda: (
            client.service_is_ready()
            and peer.has_reported("matched", "reader", "rq/switchRequest", "1")
            and peer.has_reported("matched", "writer", "rr/switchReply", "1")
        )
    )
    future = client.call_async(SetBool.Request(data=True))
    spin_until(lambda: peer.samples("rq/switchRequest"))
    request = peer.samples("rq/switchRequest")[0]
    assert request[4 + HEADER] == 1
    header = request[4 : 4 + HEADER]
    peer.send("rr/switchReply", b"\0\1\0\0" + header + b"\1\0\0\0" + b"\3\0\0\0ok\0")
    spin_until(future.done)
    assert future.result() == SetBool.Response(success=True, message="ok")
