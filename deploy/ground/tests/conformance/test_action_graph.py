"""Actions in the graph: their topics, services, types and QoS, and the functions that find them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest
from deploy.ground.tests.conformance.fibonacci import PACKAGE, Fibonacci
from deploy.ground.tests.nodes import Call, MakeNode, SpinUntil
from rclpy.action import (
    ActionClient,
    ActionServer,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclpy.action.server import ServerGoalHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64
from type_description_interfaces.srv import GetTypeDescription

FIBONACCI = f"{PACKAGE}/action/Fibonacci"
# The hash of this type in ROS 2.
FIBONACCI_HASH = {
    "example_interfaces": "RIHS01_9508051da1ea4658de144b09bd0690ff3de52104683d847aed764d2915906f51",
    "test_msgs": "RIHS01_be9273e3557225044b4a040811112491f7079326e3a573f83258b0b4c30bd069",
}[PACKAGE]


def fibonacci(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
    goal_handle.succeed()
    return Fibonacci.Result()


@pytest.fixture
def server(node: Node) -> Iterator[ActionServer]:
    server = ActionServer(node, Fibonacci, "fibonacci", fibonacci)
    yield server
    with suppress(ValueError):  # rclpy, of a server that the test has destroyed
        server.destroy()


@pytest.fixture
def client(make_node: MakeNode, executor: SingleThreadedExecutor) -> Iterator[ActionClient]:
    node = make_node("asker", namespace="/far")
    executor.add_node(node)
    client = ActionClient(node, Fibonacci, "/fibonacci")
    yield client
    with suppress(ValueError):
        client.destroy()


def test_an_action_is_made_of_hidden_topics_and_services(
    node: Node, server: ActionServer, client: ActionClient
) -> None:
    assert client.wait_for_server(timeout_sec=10)
    topics = dict(node.get_topic_names_and_types())
    services = dict(node.get_service_names_and_types())
    assert topics["/fibonacci/_action/feedback"] == [f"{FIBONACCI}_FeedbackMessage"]
    assert topics["/fibonacci/_action/status"] == ["action_msgs/msg/GoalStatusArray"]
    assert {name: types for name, types in services.items() if "_action" in name} == {
        "/fibonacci/_action/cancel_goal": ["action_msgs/srv/CancelGoal"],
        "/fibonacci/_action/get_result": [f"{FIBONACCI}_GetResult"],
        "/fibonacci/_action/send_goal": [f"{FIBONACCI}_SendGoal"],
    }
    (status,) = node.get_publishers_info_by_topic("/fibonacci/_action/status")
    assert status.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    (feedback,) = node.get_publishers_info_by_topic("/fibonacci/_action/feedback")
    assert feedback.qos_profile.durability == DurabilityPolicy.VOLATILE
    assert [one.node_name for one in node.get_subscriptions_info_by_topic("/fibonacci/_action/status")] == [
        "asker"
    ]


def test_the_qos_of_an_action_may_be_chosen(node: Node, spin_until: SpinUntil) -> None:
    chosen = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    server = ActionServer(
        node,
        Fibonacci,
        "fibonacci",
        fibonacci,
        goal_service_qos_profile=QoSProfile(depth=3),
        result_service_qos_profile=QoSProfile(depth=3),
        cancel_service_qos_profile=QoSProfile(depth=3),
        feedback_pub_qos_profile=chosen,
        status_pub_qos_profile=QoSProfile(depth=1),
    )
    spin_until(lambda: node.count_publishers("/fibonacci/_action/feedback"))
    (feedback,) = node.get_publishers_info_by_topic("/fibonacci/_action/feedback")
    (status,) = node.get_publishers_info_by_topic("/fibonacci/_action/status")
    assert feedback.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert status.qos_profile.durability == DurabilityPolicy.VOLATILE
    server.destroy()


def test_an_action_belongs_to_the_namespace_and_rules_of_its_node(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    rules = ["--ros-args", "-r", "count/_action/feedback:=elsewhere"]
    node = make_node("counter", namespace="/far", cli_args=rules)
    server = ActionServer(node, Fibonacci, "count", fibonacci)
    spin_until(lambda: node.count_services("/far/count/_action/send_goal"))
    topics = {"/far/elsewhere", "/far/count/_action/status"}
    spin_until(lambda: topics <= dict(node.get_topic_names_and_types()).keys())
    server.destroy()


def test_actions_are_found_with_their_types(
    node: Node, server: ActionServer, client: ActionClient, spin_until: SpinUntil
) -> None:
    node.create_publisher(Float64, "no/_action/status", 1)
    assert client.wait_for_server(timeout_sec=10)
    assert get_action_names_and_types(node) == [("/fibonacci", [FIBONACCI])]


def test_the_nodes_of_actions_are_found(
    node: Node, server: ActionServer, client: ActionClient, spin_until: SpinUntil
) -> None:
    found = [("/fibonacci", [FIBONACCI])]
    spin_until(lambda: get_action_server_names_and_types_by_node(node, "node", "/") == found)
    spin_until(lambda: get_action_client_names_and_types_by_node(node, "asker", "/far") == found)
    assert get_action_client_names_and_types_by_node(node, "node", "/") == []
    assert get_action_server_names_and_types_by_node(node, "asker", "/far") == []


def test_an_unknown_node_has_no_actions(node: Node) -> None:
    for find in (get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node):
        with pytest.raises(rclpy_implementation.RCLError):
            find(node, "nobody", "/")


def test_a_destroyed_action_disappears(
    node: Node, server: ActionServer, client: ActionClient, spin_until: SpinUntil
) -> None:
    assert client.wait_for_server(timeout_sec=10)
    server.destroy()
    spin_until(lambda: get_action_server_names_and_types_by_node(node, "node", "/") == [])
    assert get_action_names_and_types(node) == [("/fibonacci", [FIBONACCI])]
    client.destroy()
    spin_until(lambda: get_action_names_and_types(node) == [])


def test_the_type_of_an_action_in_use_is_described(server: ActionServer, call: Call) -> None:
    service = "node/get_type_description"
    response = call(GetTypeDescription, service, type_name=FIBONACCI, type_hash=FIBONACCI_HASH)
    assert (response.successful, response.failure_reason) == (True, "")
    top = response.type_description.type_description
    assert [field.name for field in top.fields] == [
        "goal",
        "result",
        "feedback",
        "send_goal_service",
        "get_result_service",
        "feedback_message",
    ]
    sources = {source.type_name: source.encoding for source in response.type_sources}
    assert (sources[FIBONACCI], sources[f"{FIBONACCI}_Goal"]) == ("action", "implicit")
    assert sources[f"{FIBONACCI}_SendGoal"] == "implicit"
