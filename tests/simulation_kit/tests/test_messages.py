"""Messages: the octets of a message depend on nothing else."""

from __future__ import annotations

import struct
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.srv import SetParameters
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool

from rclpy_ground import services
from rclpy_ground.interface import Sample
from rclpy_ground.messages import type_of


def message(length: int) -> DiagnosticArray:
    values = [KeyValue(key="k" * (n % 6), value="v" * (n % 5)) for n in range(length)]
    return DiagnosticArray(status=[DiagnosticStatus(name="abc", values=values)])


def test_octets_between_fields_are_not_those_of_the_heap() -> None:
    octets: set[int] = set()
    for turn in range(2000):
        freed = [bytearray(b"\x7f" * size) for size in (64, 128, 256, 512, 1024, 2048, 4096)]
        del freed
        octets.update(serialize_message(message(turn % 20)))
    assert 0x7F not in octets


@pytest.mark.parametrize("length", [70_000, 500_000])
def test_a_message_larger_than_the_buffer_is_whole(length: int) -> None:
    large = String(data="x" * length)
    assert deserialize_message(serialize_message(large), String) == large
    assert serialize_message(large) == serialize_message(large)
    assert deserialize_message(serialize_message(Float64(data=1.5)), Float64).data == 1.5


@pytest.mark.parametrize(
    ("request_", "bad"),
    [(SetBool.Request(data=True), b""), (SetParameters.Request(), struct.pack("<I", 2**24))],
    ids=["too short", "lies about its length"],
)
def test_request_that_cannot_be_read_is_dropped(request_: Any, bad: bytes) -> None:
    header = b"\0\1\0\0" + struct.pack("<Qq", 7, 1)
    octets = [header[:9], header + bad, header + serialize_message(request_)[4:]]
    take = partial(next, (Sample(data, 0, 0) for data in octets), None)
    side: Any = SimpleNamespace(reader=SimpleNamespace(take=take), _is_of_our_form=lambda handle: True)
    taken = services._Side._take(side, type(request_), None)
    assert taken is not None
    assert taken[1] == request_


def test_types_have_their_dds_names_and_hashes() -> None:
    name, hash_ = type_of(String)
    assert name == "std_msgs::msg::dds_::String_"
    assert hash_ == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert type_of(SetBool.Request)[0] == "std_srvs::srv::dds_::SetBool_Request_"
