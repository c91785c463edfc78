"""What other packages import from `ros2cli` and `ros2topic`: py_trees_ros does."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import pytest

from rclpy.context import Context
from rclpy.node import Node
from ros2cli.node.strategy import NodeStrategy, add_arguments
from ros2topic.api import get_msg_class, get_topic_names, get_topic_names_and_types
from std_msgs.msg import Float64, String

LIMIT = 10.0  # s


def publish(node: Node, message_type: Any, topic: str) -> None:
    """Create a publisher; return when the graph shows it."""
    node.create_publisher(message_type, topic, 10)
    wait_for_type(node, message_type, topic)


def wait_for_type(node: Node, message_type: Any, topic: str) -> None:
    """Wait until a node knows that a topic has this type."""
    name = f"std_msgs/msg/{message_type.__name__}"
    deadline = time.monotonic() + LIMIT
    while name not in dict(node.get_topic_names_and_types()).get(topic, []):
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def talker(node: Node) -> Node:
    """A node with a topic and a hidden topic."""
    publish(node, String, "/chatter")
    publish(node, Float64, "/_hidden")
    return node


def test_hidden_topics_are_asked_for(talker: Node) -> None:
    assert ("/chatter", ["std_msgs/msg/String"]) in get_topic_names_and_types(node=talker)
    assert "/_hidden" not in get_topic_names(node=talker)
    assert "/_hidden" in get_topic_names(node=talker, include_hidden_topics=True)


def test_message_class_is_that_of_the_topic(talker: Node) -> None:
    assert get_msg_class(talker, "chatter") is String
    assert get_msg_class(talker, "/_hidden", include_hidden_topics=True) is Float64


def test_message_class_of_an_unknown_topic_is_a_warning(talker: Node, capsys: Any) -> None:
    assert get_msg_class(talker, "/_hidden") is None
    assert capsys.readouterr().out == "WARNING: topic [/_hidden] does not appear to be published yet\n"


def test_message_class_may_be_waited_for(talker: Node) -> None:
    assert get_msg_class(talker, "/chatter", blocking=True) is String


def test_a_topic_of_two_types_has_no_message_class(
    talker: Node, make_node: Callable[..., Node], other_context: Context
) -> None:
    publish(make_node(context=other_context), Float64, "/chatter")  # Fast DDS allows a participant one type
    wait_for_type(talker, Float64, "/chatter")
    with pytest.raises(RuntimeError, match="more than one type"):
        get_msg_class(talker, "/chatter")


def test_an_invalid_name_has_no_message_class(talker: Node) -> None:
    with pytest.raises(RuntimeError, match="must not contain characters other than"):
        get_msg_class(talker, "/chat ter")


def test_node_of_a_tool_has_the_methods_of_a_node(module_domain_id: int, monkeypatch: Any) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(module_domain_id))
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    with NodeStrategy(parser.parse_args(["--no-daemon", "--spin-time", "0.1"])) as node:
        assert node.get_name() in [name for name, _ in node.get_node_names_and_namespaces()]
        assert node.get_name().startswith("_ros2cli")
