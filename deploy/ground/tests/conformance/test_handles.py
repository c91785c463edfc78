"""Names and handles of a node: invalid names, use after shutdown and after destruction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rclpy.context import Context
from rclpy.exceptions import (
    InvalidHandle,
    InvalidServiceNameException,
    InvalidTopicNameException,
)
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

RCLError = rclpy_implementation.RCLError


@pytest.mark.parametrize("name", ["", "a b", "9a", "/", "a//b", "{unknown}", "~/{ns}/a"])
@pytest.mark.parametrize("only_expand", [False, True])
@pytest.mark.parametrize("resolve", [Node.resolve_topic_name, Node.resolve_service_name])
def test_an_invalid_name_is_not_resolved(
    make_node: MakeNode, resolve: Callable[..., str], name: str, only_expand: bool
) -> None:
    with pytest.raises(RCLError, match="failed to resolve name"):
        resolve(make_node(), name, only_expand=only_expand)


@pytest.mark.parametrize("name", ["", "a b", "a//b"])
def test_an_invalid_name_creates_nothing(make_node: MakeNode, name: str) -> None:
    node = make_node()
    with pytest.raises(InvalidTopicNameException):
        node.create_publisher(Float64, name, 1)
    with pytest.raises(InvalidTopicNameException):
        node.create_subscription(Float64, name, print, 1)
    with pytest.raises(InvalidServiceNameException):
        node.create_service(Trigger, name, print)
    with pytest.raises(InvalidServiceNameException):
        node.create_client(Trigger, name)


QUERIES: list[Callable[[Node], Any]] = [
    Node.get_node_names,
    Node.get_node_names_and_namespaces,
    Node.get_node_names_and_namespaces_with_enclaves,
    Node.get_fully_qualified_node_names,
    Node.get_topic_names_and_types,
    Node.get_service_names_and_types,
    lambda node: node.count_publishers("x"),
    lambda node: node.count_services("x"),
    lambda node: node.get_publishers_info_by_topic("x"),
    lambda node: node.get_publisher_names_and_types_by_node("node", "/"),
]
CREATIONS: list[Callable[[Node], Any]] = [
    lambda node: node.create_publisher(Float64, "x", 1),
    lambda node: node.create_subscription(Float64, "x", print, 1),
    lambda node: node.create_service(Trigger, "x", print),
    lambda node: node.create_client(Trigger, "x"),
    lambda node: node.create_timer(1.0, print),
    lambda node: node.create_guard_condition(print),
]


@pytest.mark.parametrize("use", QUERIES + CREATIONS)
def test_after_the_shutdown_a_node_knows_only_its_names(
    make_node: MakeNode, context: Context, use: Callable[[Node], Any]
) -> None:
    node = make_node()
    context.shutdown()
    with pytest.raises(RCLError, match=r"shut down|context is (?:not |in)valid"):
        use(node)
    assert node.get_fully_qualified_name() == node.resolve_topic_name("node") == "/node"


@pytest.mark.parametrize("use", QUERIES + CREATIONS[:4])
def test_a_destroyed_node_is_an_invalid_handle(make_node: MakeNode, use: Callable[[Node], Any]) -> None:
    node = make_node()
    node.destroy_node()
    with pytest.raises(InvalidHandle):
        use(node)


def test_entering_and_leaving_a_handle_changes_nothing(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    entities: list[Any] = [
        node,
        context,
        node.get_clock(),
        node.create_publisher(Float64, "x", 1),
        node.create_subscription(Float64, "x", print, 1),
        node.create_service(Trigger, "x", print),
        node.create_client(Trigger, "x"),
        node.create_timer(1.0, print),
        node.create_guard_condition(print),
    ]
    for entity in entities:
        with entity.handle as nothing:
            assert nothing is None
        assert entity.handle
    assert context.ok()
    assert context.handle.ok()
    assert context.handle.get_domain_id() == context.get_domain_id()


def test_a_subscription_can_be_polled(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make_node()
    executor.remove_node(node)  # the executor would take the messages
    subscription = node.create_subscription(Float64, "x", print, 10)
    publisher = node.create_publisher(Float64, "x", 10)
    spin_until(publisher.get_subscription_count)
    publisher.publish(Float64(data=1.0))
    publisher.publish(Float64(data=2.0))
    taken: list[tuple[Any, dict[str, Any]]] = []

    def take(raw: bool) -> bool:
        with subscription.handle:
            sample = subscription.handle.take_message(Float64, raw)
        if sample is not None:
            taken.append(sample)
        return sample is not None

    spin_until(lambda: take(raw=False))
    spin_until(lambda: take(raw=True))
    assert not take(raw=False)
    (message, info), (data, _) = taken
    assert message == Float64(data=1.0)
    assert 0 < info["source_timestamp"] <= info["received_timestamp"]
    assert deserialize_message(data, Float64) == Float64(data=2.0)


def test_each_entity_knows_the_logger_of_its_node(make_node: MakeNode) -> None:
    node = make_node("talker", namespace="/arm1")
    entities = [
        node.create_publisher(Float64, "x", 1),
        node.create_subscription(Float64, "x", lambda _: None, 1),
        node.create_service(Trigger, "y", lambda request, response: response),
        node.create_client(Trigger, "y"),
    ]
    assert {entity.logger_name for entity in entities} == {"arm1.talker"}
