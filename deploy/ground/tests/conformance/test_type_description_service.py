"""The service ``~/get_type_description``: descriptions and sources of the types that a node uses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from deploy.ground.tests.nodes import Call, MakeNode
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

Ask = Callable[..., Any]

# The hashes of these types in ROS 2.
TRIGGER_REQUEST = "RIHS01_d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199"
TRIGGER_EVENT = "RIHS01_ec4a1d26b0575e61906890342aba9523a2360e9845857c5590fa6e23bc39e1c2"
HEADER = "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"
TRIGGER = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
FLOAT64 = "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a"
NOT_IN_USE = "Type not currently in use by this node"


@pytest.fixture
def node(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    """A node that publishes a Header and serves a Trigger; an error in a callback fails the test."""
    node = make_node("node")
    executor.add_node(node)
    node.create_publisher(Header, "x", 1)
    node.create_service(Trigger, "trigger", lambda request, response: response)
    return node


@pytest.fixture
def ask(call: Call) -> Ask:
    return partial(call, GetTypeDescription, "node/get_type_description")


def described(response: Any) -> list[str]:
    """Names of the type and of all types that it refers to, in the order of the response."""
    assert (response.successful, response.failure_reason) == (True, "")
    top = response.type_description
    individual = [top.type_description, *top.referenced_type_descriptions]
    return [description.type_name for description in individual]


def test_a_message_is_described_with_the_files_that_define_it(ask: Ask) -> None:
    response = ask(type_name="std_msgs/msg/Header", type_hash=HEADER)
    assert described(response) == ["std_msgs/msg/Header", "builtin_interfaces/msg/Time"]
    header, time = response.type_sources
    assert (header.type_name, header.encoding) == ("std_msgs/msg/Header", "msg")
    assert "string frame_id" in header.raw_file_contents
    assert (time.type_name, time.encoding) == ("builtin_interfaces/msg/Time", "msg")
    assert "uint32 nanosec" in time.raw_file_contents


def test_sources_are_included_only_on_request(ask: Ask) -> None:
    response = ask(type_name="std_msgs/msg/Header", type_hash=HEADER, include_type_sources=False)
    assert len(described(response)) == 2
    assert response.type_sources == []


def test_the_messages_of_a_service_have_implicit_sources(ask: Ask) -> None:
    response = ask(type_name="std_srvs/srv/Trigger", type_hash=TRIGGER)
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


def test_the_hash_alone_identifies_the_type(ask: Ask) -> None:
    assert described(ask(type_name="std_msgs/msg/Nothing", type_hash=HEADER))[0] == "std_msgs/msg/Header"
    assert described(ask(type_name="std_msgs/msg/Header", type_hash=TRIGGER))[0] == "std_srvs/srv/Trigger"


@pytest.mark.parametrize(
    ("type_name", "type_hash", "reason"),
    [
        ("std_msgs/msg/Float64", FLOAT64, NOT_IN_USE),
        ("std_srvs/srv/Trigger_Request", TRIGGER_REQUEST, NOT_IN_USE),
        ("std_srvs/srv/Trigger_Event", TRIGGER_EVENT, NOT_IN_USE),
        ("example_interfaces/action/Fibonacci", f"RIHS01_{'0' * 64}", NOT_IN_USE),
        ("std_msgs/msg/Header", f"RIHS01_{'0' * 64}", NOT_IN_USE),
        ("std_msgs/msg/Header", "RIHS01_0", "Failed to parse type hash"),
        ("Header", "", "Failed to parse type hash"),
    ],
)
def test_a_type_that_the_node_does_not_use_is_not_described(
    ask: Ask, type_name: str, type_hash: str, reason: str
) -> None:
    response = ask(type_name=type_name, type_hash=type_hash)
    assert (response.successful, response.failure_reason) == (False, reason)
    assert response.type_sources == []
