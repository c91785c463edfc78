"""The graph: discovery of nodes and endpoints, their descriptions, and remapping."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from deploy.ground.tests.conformance.middleware import announced_history
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

FACTS = Path(__file__).parents[1] / "facts"


@pytest.fixture
def node(facts_node: Node, spin_until: SpinUntil) -> Node:
    """The facts node, after the discovery of its last publisher, subscription and service."""
    spin_until(
        lambda: (
            facts_node.count_publishers("/engines")
            and facts_node.count_subscribers("operator_heartbeat")
            and facts_node.count_services("turn_on")
        )
    )
    return facts_node


def recorded_hash(topic: str) -> str:
    """The type hash that a real node announced with its publisher of the topic."""
    text = (FACTS / "discovery.txt").read_text()
    match = re.search(rf"^PUB \S+ {topic} .*?typehash=(\w+);", text, re.MULTILINE)
    assert match
    return match[1]


def test_nodes_of_another_participant_appear_and_disappear(
    make_node: MakeNode, other_context: Context, spin_until: SpinUntil
) -> None:
    here = make_node("here")
    there = Node("there", namespace="/far", context=other_context)
    assert here.wait_for_node("/far/there", timeout=10)
    assert ("there", "/far") in here.get_node_names_and_namespaces()
    assert ("there", "/far", "/") in here.get_node_names_and_namespaces_with_enclaves()
    there.destroy_node()
    spin_until(lambda: here.get_node_names() == ["here"])


def test_topics_and_types_are_listed_with_and_without_demangling(node: Node) -> None:
    topics = dict(node.get_topic_names_and_types())
    assert topics["/arm1/l1"] == ["std_msgs/msg/Float64"]
    assert topics["/arm1/operator_heartbeat"] == ["std_msgs/msg/Bool"]
    assert "ros_discovery_info" not in topics
    assert dict(node.get_topic_names_and_types(no_demangle=True))["rt/arm1/l1"] == [
        "std_msgs::msg::dds_::Float64_"
    ]


def test_endpoints_are_listed_by_node(node: Node, make_node: MakeNode, spin_until: SpinUntil) -> None:
    client = make_node("caller")
    client.create_client(Trigger, "/arm1/turn_on")
    spin_until(lambda: node.get_client_names_and_types_by_node("caller", "/"))
    assert dict(node.get_publisher_names_and_types_by_node("facts", "/arm1")).keys() == {
        "/arm1/l1",
        "/arm1/effector/position",
        "/engines",
        "/rosout",
        "/parameter_events",
    }
    assert dict(node.get_subscriber_names_and_types_by_node("facts", "/arm1")).keys() == {
        "/arm1/operator_heartbeat"
    }
    assert ("/arm1/turn_on", ["std_srvs/srv/Trigger"]) in node.get_service_names_and_types_by_node(
        "facts", "/arm1"
    )
    assert node.get_client_names_and_types_by_node("caller", "/") == [
        ("/arm1/turn_on", ["std_srvs/srv/Trigger"])
    ]
    assert ("/arm1/turn_on", ["std_srvs/srv/Trigger"]) in node.get_service_names_and_types()


def test_a_query_for_an_unknown_node_is_an_error(make_node: MakeNode) -> None:
    with pytest.raises(rclpy_implementation.NodeNameNonExistentError):
        make_node().get_publisher_names_and_types_by_node("missing", "/nowhere")


def test_endpoints_are_described_with_node_type_qos_and_hash(node: Node) -> None:
    (info,) = node.get_publishers_info_by_topic("l1")
    assert (info.node_name, info.node_namespace) == ("facts", "/arm1")
    assert info.topic_type == "std_msgs/msg/Float64"
    assert str(info.topic_type_hash) == recorded_hash("rt/arm1/l1")
    assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert (info.qos_profile.history, info.qos_profile.depth) == announced_history(1)
    assert len(info.endpoint_gid) == 16
    (info,) = node.get_subscriptions_info_by_topic("operator_heartbeat")
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_publishers_and_subscribers_are_counted(node: Node) -> None:
    assert node.count_publishers("l1") == 1
    assert node.count_subscribers("l1") == 0
    assert node.count_subscribers("operator_heartbeat") == 1
    assert node.count_services("turn_on") == 1
    assert node.count_clients("turn_on") == 0


def test_a_late_subscription_gets_the_latched_message(make_node: MakeNode, other_context: Context) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = make_node().create_publisher(Float64, "l1", latched)
    for value in (1.0, 2.0):
        publisher.publish(Float64(data=value))
    received: list[float] = []
    late = Node("late", context=other_context)
    late.create_subscription(Float64, "l1", lambda message: received.append(message.data), latched)
    with SingleThreadedExecutor(context=other_context) as executor:
        executor.add_node(late)
        while not received:
            executor.spin_once(timeout_sec=10)
    late.destroy_node()
    assert received == [2.0]


def test_arguments_remap_names(make_node: MakeNode) -> None:
    rules = "x:=y", "__node:=renamed", "__ns:=/arm2", "serve:=/other"
    node = make_node(cli_args=["--ros-args", *(word for rule in rules for word in ("-r", rule))])
    assert node.get_fully_qualified_name() == "/arm2/renamed"
    assert node.resolve_topic_name("x") == "/arm2/y"
    assert node.resolve_topic_name("x", only_expand=True) == "/arm2/x"
    assert node.create_publisher(Float64, "x", 1).topic_name == "/arm2/y"
    assert node.resolve_service_name("serve") == "/other"


def test_listing_endpoints_remaps_the_name_but_counting_does_not(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    rules = "x:=y", "serve:=/other"
    node = make_node(cli_args=["--ros-args", *(word for rule in rules for word in ("-r", rule))])
    node.create_publisher(Float64, "x", 1)
    node.create_subscription(Float64, "x", lambda message: None, 1)
    node.create_service(Trigger, "serve", lambda request, response: response)
    node.create_client(Trigger, "serve")
    spin_until(lambda: node.count_subscribers("y") and node.count_clients("/other"))
    assert (node.count_publishers("x"), node.count_publishers("y")) == (0, 1)
    assert (node.count_subscribers("x"), node.count_subscribers("y")) == (0, 1)
    assert (node.count_services("serve"), node.count_services("/other")) == (0, 1)
    assert (node.count_clients("serve"), node.count_clients("/other")) == (0, 1)
    assert len(node.get_publishers_info_by_topic("x")) == len(node.get_subscriptions_info_by_topic("x")) == 1
