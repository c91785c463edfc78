"""What other packages import from `ros2cli`, `ros2topic` and so on: py_trees_ros and rosapi do."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from deploy.runtime.tests.host import wait_until
from deploy.runtime.tests.nodes import MakeNode

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros2action.api import get_action_names, get_action_names_and_types
from ros2cli.node.strategy import NodeStrategy, add_arguments
from ros2interface.api import interface_to_yaml, type_completer
from ros2node.api import (
    get_absolute_node_name,
    get_action_client_info,
    get_action_server_info,
    get_node_names,
    get_publisher_info,
    get_service_client_info,
    get_service_server_info,
    get_subscriber_info,
    parse_node_name,
)
from ros2param.api import (
    call_describe_parameters,
    call_get_parameters,
    call_list_parameters,
    call_set_parameters,
    get_parameter_type_string,
    get_value,
)
from ros2pkg.api import PackageNotFound, get_executable_paths, get_package_names, get_prefix_path
from ros2service.api import get_service_class, get_service_names
from ros2topic.api import get_msg_class, get_topic_names, get_topic_names_and_types
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool


def publish(node: Node, message_type: Any, topic: str) -> None:
    """Create a publisher; return when the graph shows it."""
    node.create_publisher(message_type, topic, 10)
    wait_for_type(node, message_type, topic)


def wait_for_type(node: Node, message_type: Any, topic: str) -> None:
    name = f"std_msgs/msg/{message_type.__name__}"
    wait_until(lambda: name in dict(node.get_topic_names_and_types()).get(topic, []))


@pytest.fixture
def talker(node: Node) -> Node:
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
    talker: Node, make_node: MakeNode, other_context: Context
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


# Other nodes and their parameters


LAB = "/arm/lab"


@pytest.fixture
def asker(lab: Any, module_domain_id: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(module_domain_id))
    rclpy.init(args=[])
    node = rclpy.create_node("asker")
    wait_until(lambda: LAB in [name.full_name for name in get_node_names(node=node)])
    yield node
    node.destroy_node()
    rclpy.shutdown()


def test_names_of_nodes_are_taken_apart() -> None:
    assert parse_node_name("arm/lab") == parse_node_name("/arm/lab") == ("lab", "/arm", "/arm/lab")
    assert parse_node_name("/lab").namespace == "/"
    assert get_absolute_node_name("lab") == get_absolute_node_name("/lab") == "/lab"
    assert get_absolute_node_name("") is None


def test_a_node_is_asked_what_it_has(asker: Node) -> None:
    whose: dict[str, Any] = {"node": asker, "remote_node_name": LAB}
    assert ("/arm/point", ["geometry_msgs/msg/PointStamped"]) in get_publisher_info(**whose)
    assert ("/arm/switch", ["std_srvs/srv/SetBool"]) in get_service_server_info(**whose)
    assert "/arm/lab/get_parameters" in [info.name for info in get_service_server_info(**whose)]
    for ask in (get_subscriber_info, get_service_client_info, get_action_server_info, get_action_client_info):
        assert all(info.name and info.types for info in ask(**whose))
    assert get_action_names(node=asker) == [name for name, _ in get_action_names_and_types(node=asker)]


def test_a_service_has_a_class(asker: Node) -> None:
    assert get_service_class(asker, "/arm/switch", include_hidden_services=False) is SetBool
    assert "/arm/switch" in get_service_names(node=asker)
    with pytest.raises(RuntimeError, match="Cannot find type for '/nothing'"):
        get_service_class(asker, "/nothing", include_hidden_services=True)


def test_parameters_of_a_node_are_described_set_and_got(asker: Node) -> None:
    whose: dict[str, Any] = {"node": asker, "node_name": LAB}
    names = call_list_parameters(**whose, prefixes=["limits"])
    assert names is not None
    assert names.result().result.names == ["limits.speed"]
    (described,) = call_describe_parameters(**whose, parameter_names=["length"]).descriptors
    assert get_parameter_type_string(described.type) == "double"
    changed = Parameter("limits.speed", value=7).to_parameter_msg()
    assert call_set_parameters(**whose, parameters=[changed]).results[0].successful
    (value,) = call_get_parameters(**whose, parameter_names=["limits.speed"]).values
    assert get_value(parameter_value=value) == 7


# Interfaces and packages


def test_interfaces_are_listed_and_shown_with_their_defaults() -> None:
    assert {"std_msgs/msg/String", "std_srvs/srv/SetBool"} <= {*type_completer()}
    assert interface_to_yaml("std_srvs/srv/SetBool") == "data: false\n"
    assert interface_to_yaml("geometry_msgs/msg/Point") == "x: 0.0\ny: 0.0\nz: 0.0\n"


def test_programs_of_a_package_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / "robot").touch()
    programs = tmp_path / "lib" / "robot"
    for name, mode in (("run", 0o755), ("data", 0o644), (".hidden/run", 0o755)):
        (programs / name).parent.mkdir(parents=True, exist_ok=True)
        (programs / name).touch(mode)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert "robot" in get_package_names()
    assert get_prefix_path("robot") == str(tmp_path)
    assert get_executable_paths(package_name="robot") == [str(programs / "run")]
    assert get_prefix_path("nothing") is None
    with pytest.raises(PackageNotFound):
        get_executable_paths(package_name="nothing")
