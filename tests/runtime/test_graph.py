"""The graph: what nodes tell of themselves on the wire, and what they know of others."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from geometry_msgs.msg import PointStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy._dds.discovery import Discovery
from rclpy._graph import NodeEntities, decode, encode
from rclpy.context import Context
from rclpy.exceptions import NodeNameNonExistentError
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import Trigger

MakeNode = Callable[..., Node]
SpinUntil = Callable[..., None]
FACTS = Path(__file__).parents[1] / "facts"


@pytest.fixture
def other_context(domain_id: int) -> Iterator[Context]:
    """A second participant in the test's domain, as another process would be."""
    context = Context()
    context.init([], domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()


def facts_node(make_node: MakeNode) -> Node:
    """The node that tests/facts/discovery.txt was recorded from."""
    node = make_node("facts", namespace="/arm1")
    node.declare_parameter("value", 2.0)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(Float64, "l1", latched)
    node.create_publisher(PointStamped, "effector/position", 10)
    node.create_publisher(String, "/engines", 10)
    node.create_subscription(Bool, "operator_heartbeat", lambda _: None, qos_profile_sensor_data)
    node.create_service(Trigger, "turn_on", lambda request, response: response)
    return node


def recorded(kind: str) -> dict[str, tuple[str, str]]:
    """Topic → (type, user data without the service's own identifier) of the recorded endpoints."""
    endpoints = {}
    for line in (FACTS / "discovery.txt").read_text().splitlines():
        if line.startswith(kind):
            _, _, topic, type_name = line.split(" ")[:4]
            data = re.search(r"Policy\.Userdata\(data=b'(.*?)'\)", line)
            assert data
            endpoints[topic] = (type_name, re.sub(r"serviceid=[^;]*;", "serviceid;", data[1]))
    return endpoints


def announced(endpoints: list[object]) -> dict[str, tuple[str, str]]:
    return {
        endpoint.topic: (endpoint.type_name, re.sub(r"serviceid=[^;]*;", "serviceid;", endpoint.user_data))
        for endpoint in endpoints
    }


def test_a_node_announces_the_same_writers_and_readers_as_a_real_one(make_node: MakeNode) -> None:
    node = facts_node(make_node)
    discovery = Discovery(node._graph.participant.handle)
    assert announced(discovery.writers()) == recorded("PUB")
    assert announced(discovery.readers()) == recorded("SUB")


def test_a_participant_announces_its_enclave_as_a_real_one(make_node: MakeNode) -> None:
    node = make_node()
    graph = node._graph
    assert Discovery(graph.participant.handle).participants()[graph.participant.gid] == "enclave=/;"


def test_service_identifiers_have_the_form_of_the_recorded_ones(make_node: MakeNode) -> None:
    graph = facts_node(make_node)._graph
    data = [endpoint.user_data for endpoint in Discovery(graph.participant.handle).writers()]
    identifiers = [
        match[1] for text in data if (match := re.match(r"serviceid=( [0-9a-f.]+);typehash", text))
    ]
    assert len(identifiers) == len(set(identifiers)) == 8
    prefix = ".".join(f"{octet:x}" for octet in graph.participant.gid[:12])
    assert set(identifiers) == {f" {prefix}.0.0.0.{number:x}" for number in range(1, 9)}


def test_the_recorded_discovery_info_is_read_and_written_back_octet_by_octet() -> None:
    data = bytes.fromhex(
        json.loads((FACTS / "wire_samples.json").read_text())["samples"]["ros_discovery_info"]
    )
    gid, nodes = decode(data)
    assert [(node.namespace, node.name) for node in nodes] == [("/arm1", "facts")]
    assert (len(nodes[0].readers), len(nodes[0].writers)) == (9, 13)
    assert encode(gid, nodes) == data


@given(st.binary(max_size=300))
def test_discovery_info_from_anybody_is_understood_or_refused(data: bytes) -> None:
    with suppress(ValueError):
        decode(b"\x00\x01\x00\x00" + data)


@given(
    st.lists(
        st.tuples(
            st.text(alphabet=st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
            st.text(alphabet=st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
            st.lists(st.binary(min_size=16, max_size=16), max_size=3),
            st.lists(st.binary(min_size=16, max_size=16), max_size=3),
        ),
        max_size=4,
    )
)
def test_discovery_info_survives_writing_and_reading(
    nodes: list[tuple[str, str, list[bytes], list[bytes]]],
) -> None:
    entities = []
    for namespace, name, readers, writers in nodes:
        node = NodeEntities(namespace, name)
        node.readers, node.writers = readers, writers
        entities.append(node)
    gid, result = decode(encode(bytes(range(16)), entities))
    assert gid == bytes(range(16))
    assert [(node.namespace, node.name, node.readers, node.writers) for node in result] == nodes


def test_nodes_of_another_participant_are_seen_and_their_end_too(
    make_node: MakeNode, other_context: Context
) -> None:
    here = make_node("here")
    there = Node("there", namespace="/far", context=other_context)
    assert here.wait_for_node("/far/there", timeout=10)
    assert ("there", "/far") in here.get_node_names_and_namespaces()
    assert ("there", "/far", "/") in here.get_node_names_and_namespaces_with_enclaves()
    there.destroy_node()
    assert here._graph.wait_for(lambda: here.get_node_names() == ["here"], 10, here.context.ok)


def test_waiting_for_a_node_that_never_comes_ends_with_its_timeout(make_node: MakeNode) -> None:
    assert not make_node().wait_for_node("/nobody", timeout=0.05)


def test_topics_and_types_are_listed_with_and_without_demangling(make_node: MakeNode) -> None:
    node = facts_node(make_node)
    topics = dict(node.get_topic_names_and_types())
    assert topics["/arm1/l1"] == ["std_msgs/msg/Float64"]
    assert topics["/arm1/operator_heartbeat"] == ["std_msgs/msg/Bool"]
    assert "ros_discovery_info" not in topics
    assert dict(node.get_topic_names_and_types(no_demangle=True))["rt/arm1/l1"] == [
        "std_msgs::msg::dds_::Float64_"
    ]


def test_what_a_node_has_is_listed_by_node(make_node: MakeNode) -> None:
    node = facts_node(make_node)
    client = make_node("caller")
    client.create_client(Trigger, "/arm1/turn_on")
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


def test_asking_for_an_unknown_node_is_an_error_that_names_it(make_node: MakeNode) -> None:
    with pytest.raises(NodeNameNonExistentError, match="/nowhere/nobody"):
        make_node().get_publisher_names_and_types_by_node("nobody", "/nowhere")


def test_endpoints_are_described_with_node_type_qos_and_hash(make_node: MakeNode) -> None:
    node = facts_node(make_node)
    (info,) = node.get_publishers_info_by_topic("l1")
    assert (info.node_name, info.node_namespace) == ("facts", "/arm1")
    assert info.topic_type == "std_msgs/msg/Float64"
    assert str(info.topic_type_hash) == Float64._TYPE_HASH
    assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert info.qos_profile.depth == 1
    assert len(info.endpoint_gid) == 16
    (info,) = node.get_subscriptions_info_by_topic("operator_heartbeat")
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_publishers_and_subscribers_are_counted(make_node: MakeNode) -> None:
    node = facts_node(make_node)
    assert node.count_publishers("l1") == 1
    assert node.count_subscribers("l1") == 0
    assert node.count_subscribers("operator_heartbeat") == 1
    assert node.count_services("turn_on") == 1
    assert node.count_clients("turn_on") == 0


def test_a_late_subscription_in_another_participant_gets_the_latched_message(
    make_node: MakeNode, other_context: Context
) -> None:
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


def test_names_are_remapped_by_arguments(make_node: MakeNode) -> None:
    rules = "x:=y", "__node:=renamed", "__ns:=/arm2", "serve:=/other"
    node = make_node(cli_args=["--ros-args", *(word for rule in rules for word in ("-r", rule))])
    assert node.get_fully_qualified_name() == "/arm2/renamed"
    assert node.resolve_topic_name("x") == "/arm2/y"
    assert node.resolve_topic_name("x", only_expand=True) == "/arm2/x"
    assert node.create_publisher(Float64, "x", 1).topic_name == "/arm2/y"
    assert node.resolve_service_name("serve") == "/other"


def test_to_count_endpoints_does_not_remap_their_name_to_list_them_does(make_node: MakeNode) -> None:
    rules = "x:=y", "serve:=/other"
    node = make_node(cli_args=["--ros-args", *(word for rule in rules for word in ("-r", rule))])
    node.create_publisher(Float64, "x", 1)
    node.create_subscription(Float64, "x", lambda message: None, 1)
    node.create_service(Trigger, "serve", lambda request, response: response)
    node.create_client(Trigger, "serve")
    assert (node.count_publishers("x"), node.count_publishers("y")) == (0, 1)
    assert (node.count_subscribers("x"), node.count_subscribers("y")) == (0, 1)
    assert (node.count_services("serve"), node.count_services("/other")) == (0, 1)
    assert (node.count_clients("serve"), node.count_clients("/other")) == (0, 1)
    assert len(node.get_publishers_info_by_topic("x")) == len(node.get_subscriptions_info_by_topic("x")) == 1
