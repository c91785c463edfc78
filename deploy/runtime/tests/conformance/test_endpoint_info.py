from __future__ import annotations

from typing import Any

import pytest

from rclpy.duration import Infinite
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSPresetProfiles, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden
from rclpy.type_support import check_for_type_support, check_is_valid_msg_type, check_is_valid_srv_type
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

HASH = "RIHS01_" + "0123456789abcdef" * 4


def test_an_empty_endpoint_info_has_unknown_properties() -> None:
    info = TopicEndpointInfo()
    assert (info.node_name, info.node_namespace, info.topic_type, info.endpoint_gid) == ("", "", "", [])
    assert info.endpoint_type is TopicEndpointTypeEnum.INVALID
    assert info.qos_profile == QoSPresetProfiles.UNKNOWN.value
    assert str(info.topic_type_hash) == "INVALID"


def test_the_text_of_an_endpoint_is_that_of_rclpy() -> None:
    info = TopicEndpointInfo(
        node_name="talker",
        node_namespace="/ns",
        topic_type="std_msgs/msg/String",
        topic_type_hash={"version": 1, "value": bytes.fromhex("0123456789abcdef" * 4)},
        endpoint_type=1,
        endpoint_gid=[1, 255],
        qos_profile={"depth": 7, "lifespan": Infinite},
    )
    assert str(info) == (
        "Node name: talker\n"
        "Node namespace: /ns\n"
        "Topic type: std_msgs/msg/String\n"
        f"Topic type hash: {HASH}\n"
        "Endpoint type: PUBLISHER\n"
        "GID: 01.ff\n"
        "QoS profile:\n"
        "  Reliability: RELIABLE\n"
        "  History (Depth): KEEP_LAST (7)\n"
        "  Durability: VOLATILE\n"
        "  Lifespan: Infinite\n"
        "  Deadline: 0 nanoseconds\n"
        "  Liveliness: SYSTEM_DEFAULT\n"
        "  Liveliness lease duration: 0 nanoseconds"
    )
    info.qos_profile = QoSProfile(history=2)
    assert "History (Depth): KEEP_ALL\n" in str(info)


def test_endpoints_with_equal_properties_are_equal() -> None:
    assert TopicEndpointInfo(node_name="a") == TopicEndpointInfo(node_name="a")
    assert TopicEndpointInfo(node_name="a") != TopicEndpointInfo(node_name="b")
    assert TopicEndpointInfo() != "endpoint"


@pytest.mark.parametrize(
    "properties",
    [
        {"node_name": 1},
        {"topic_type_hash": "RIHS01"},
        {"endpoint_type": "PUBLISHER"},
        {"endpoint_gid": ["a"]},
        {"qos_profile": 10},
        {"colour": "red"},
    ],
)
def test_a_property_of_a_wrong_type_or_name_is_an_error(properties: dict[str, Any]) -> None:
    with pytest.raises(AssertionError):
        TopicEndpointInfo(**properties)


def test_a_message_survives_serialization() -> None:
    data = serialize_message(String(data="hello"))
    assert data[:4] == b"\x00\x01\x00\x00"
    assert deserialize_message(data, String) == String(data="hello")
    with pytest.raises(rclpy_implementation.RMWError):
        deserialize_message(data[:5], Float64)


@pytest.mark.parametrize("data", [5, "text", None])
def test_only_bytes_can_be_deserialized(data: Any) -> None:
    with pytest.raises(TypeError):
        deserialize_message(data, Float64)


def test_only_messages_can_be_serialized() -> None:
    with pytest.raises(AttributeError):
        serialize_message("hello")
    with pytest.raises(AttributeError):
        deserialize_message(b"", str)


def test_message_and_service_types_are_told_apart() -> None:
    check_is_valid_msg_type(String)
    check_is_valid_srv_type(Trigger)
    for check in (check_for_type_support, check_is_valid_msg_type, check_is_valid_srv_type):
        with pytest.raises(AttributeError):
            check(str)
    with pytest.raises(RuntimeError, match="might be a service"):
        check_is_valid_msg_type(Trigger)
    with pytest.raises(RuntimeError, match="might be a message"):
        check_is_valid_srv_type(String)


@pytest.mark.parametrize(
    ("name", "hidden"),
    [("/chatter", False), ("/a/_b/c", True), ("_a", True), ("/a_b/c_", False), ("", False)],
)
def test_a_name_is_hidden_if_a_token_begins_with_an_underscore(name: str, hidden: bool) -> None:
    assert topic_or_service_is_hidden(name) is hidden
