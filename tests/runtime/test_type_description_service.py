"""The service ``~/get_type_description``, asked as others ask it: what it tells of the types a node uses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosidl_runtime_embedded.packages import message_class
from std_msgs.msg import Float64, Header
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

MakeNode = Callable[..., Node]
SpinUntil = Callable[..., None]
Ask = Callable[..., Any]

NOT_IN_USE = "Type not currently in use by this node"


@pytest.fixture
def node(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    """A node that publishes headers and serves a trigger; an error in one of its callbacks fails the test."""
    node = make_node("node")
    executor.add_node(node)
    node.create_publisher(Header, "x", 1)
    node.create_service(Trigger, "trigger", lambda request, response: response)
    return node


@pytest.fixture
def ask(node: Node, make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil) -> Ask:
    """Asks the node what a type looks like, from another node."""
    other = make_node("other")
    executor.add_node(other)
    client = other.create_client(GetTypeDescription, "node/get_type_description")
    spin_until(client.service_is_ready)

    def ask(type_name: str, type_hash: str, **request: Any) -> Any:
        future = client.call_async(
            GetTypeDescription.Request(type_name=type_name, type_hash=type_hash, **request)
        )
        spin_until(future.done)
        return future.result()

    return ask


def described(response: Any) -> list[str]:
    """Names of the type and of all types it refers to, in the order of the answer."""
    assert (response.successful, response.failure_reason) == (True, "")
    description = response.type_description
    individual = [description.type_description, *description.referenced_type_descriptions]
    return [one.type_name for one in individual]


def test_a_message_is_described_with_the_files_that_define_it(ask: Ask) -> None:
    response = ask("std_msgs/msg/Header", Header._TYPE_HASH)
    assert described(response) == ["std_msgs/msg/Header", "builtin_interfaces/msg/Time"]
    header, time = response.type_sources
    assert (header.type_name, header.encoding) == ("std_msgs/msg/Header", "msg")
    assert "string frame_id" in header.raw_file_contents
    assert (time.type_name, time.encoding) == ("builtin_interfaces/msg/Time", "msg")
    assert "uint32 nanosec" in time.raw_file_contents


def test_sources_are_told_only_to_who_wants_them(ask: Ask) -> None:
    response = ask("std_msgs/msg/Header", Header._TYPE_HASH, include_type_sources=False)
    assert len(described(response)) == 2
    assert response.type_sources == []


def test_the_parts_of_a_service_have_no_file_of_their_own(ask: Ask) -> None:
    response = ask("std_srvs/srv/Trigger", Trigger._TYPE_HASH)
    names = [
        "std_srvs/srv/Trigger",
        "builtin_interfaces/msg/Time",
        "service_msgs/msg/ServiceEventInfo",
        "std_srvs/srv/Trigger_Event",
        "std_srvs/srv/Trigger_Request",
        "std_srvs/srv/Trigger_Response",
    ]
    assert described(response) == names
    sources = response.type_sources
    assert [source.type_name for source in sources] == names
    assert [source.encoding for source in sources] == ["srv", "msg", "msg", *["implicit"] * 3]
    assert [bool(source.raw_file_contents) for source in sources] == [True, True, True, *[False] * 3]


def test_a_type_in_use_is_described_as_it_was_when_it_was_loaded(
    node: Node, ask: Ask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    definition = tmp_path / "share" / "changing_msgs" / "msg" / "Joint.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text("float64 angle\n")
    joint = message_class("changing_msgs/msg/Joint")
    node.create_publisher(joint, "joint", 1)
    definition.unlink()
    response = ask("changing_msgs/msg/Joint", joint._TYPE_HASH)
    assert response.type_sources[0].raw_file_contents == "float64 angle\n"


def test_the_hash_alone_says_which_type_is_meant(ask: Ask) -> None:
    assert described(ask("std_msgs/msg/Nothing", Header._TYPE_HASH))[0] == "std_msgs/msg/Header"
    assert described(ask("std_msgs/msg/Header", Trigger._TYPE_HASH))[0] == "std_srvs/srv/Trigger"


@pytest.mark.parametrize(
    ("type_name", "type_hash", "reason"),
    [
        ("std_msgs/msg/Float64", Float64._TYPE_HASH, NOT_IN_USE),
        ("std_srvs/srv/Trigger_Request", Trigger.Request._TYPE_HASH, NOT_IN_USE),
        ("std_srvs/srv/Trigger_Event", Trigger.Event._TYPE_HASH, NOT_IN_USE),
        ("example_interfaces/action/Fibonacci", f"RIHS01_{'0' * 64}", NOT_IN_USE),
        ("std_msgs/msg/Header", f"RIHS01_{'0' * 64}", NOT_IN_USE),
        ("std_msgs/msg/Header", "RIHS01_0", "Failed to parse type hash"),
        ("Header", "", "Failed to parse type hash"),
    ],
)
def test_what_the_node_does_not_use_it_does_not_describe(
    ask: Ask, type_name: str, type_hash: str, reason: str
) -> None:
    response = ask(type_name, type_hash)
    assert (response.successful, response.failure_reason) == (False, reason)
    assert response.type_sources == []
