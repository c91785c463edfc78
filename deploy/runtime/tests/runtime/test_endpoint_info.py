"""Type hashes as peers announce them, and a service type in place of a message type."""

from __future__ import annotations

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rclpy.serialization import deserialize_message
from rclpy.type_hash import TypeHash
from std_msgs.msg import String
from std_srvs.srv import Trigger

HASH = "RIHS01_" + "0123456789abcdef" * 4


def test_a_type_hash_survives_as_text() -> None:
    assert str(TypeHash._rclpy_parse(HASH)) == HASH
    assert TypeHash._rclpy_parse(HASH) == TypeHash(1, bytes.fromhex("0123456789abcdef" * 4))
    assert TypeHash() != TypeHash(version=1)


@pytest.mark.parametrize(
    "text", ["", "RIHS01", "RIHS01_00", "RIHSxx_" + "0" * 64, "RIHS01_" + "g" * 64, HASH[1:]]
)
def test_an_invalid_text_is_the_unknown_type_hash(text: str) -> None:
    assert TypeHash._rclpy_parse(text) == TypeHash()
    assert str(TypeHash._rclpy_parse(text)) == "INVALID"


def test_a_service_type_cannot_be_deserialized() -> None:
    with pytest.raises(RuntimeError, match="might be a service"):
        deserialize_message(b"", Trigger)


def test_changed_profile_of_an_endpoint_changes_no_other(make_node: MakeNode) -> None:
    node = make_node("talker")
    for topic in ("first", "second"):
        node.create_publisher(String, topic, 10)
    (first,) = node.get_publishers_info_by_topic("first")
    first.qos_profile.depth = 99
    for topic in ("first", "second"):
        (again,) = node.get_publishers_info_by_topic(topic)
        assert again.qos_profile.depth == 10
