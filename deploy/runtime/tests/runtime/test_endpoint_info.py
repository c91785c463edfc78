"""Type hashes as peers announce them, and a service type in place of a message type."""

from __future__ import annotations

import pytest

from rclpy.serialization import deserialize_message
from rclpy.type_hash import TypeHash
from std_srvs.srv import Trigger

HASH = "RIHS01_" + "0123456789abcdef" * 4


def test_a_type_hash_survives_as_text() -> None:
    assert str(TypeHash._parse(HASH)) == HASH
    assert TypeHash._parse(HASH) == TypeHash(1, bytes.fromhex("0123456789abcdef" * 4))
    assert TypeHash() != TypeHash(version=1)


@pytest.mark.parametrize(
    "text", ["", "RIHS01", "RIHS01_00", "RIHSxx_" + "0" * 64, "RIHS01_" + "g" * 64, HASH[1:]]
)
def test_an_invalid_text_is_the_unknown_type_hash(text: str) -> None:
    assert TypeHash._parse(text) == TypeHash()
    assert str(TypeHash._parse(text)) == "INVALID"


def test_a_service_type_cannot_be_deserialized() -> None:
    with pytest.raises(RuntimeError, match="might be a service"):
        deserialize_message(b"", Trigger)
