"""Message types against the bytes and announcements of a real ROS 2 Jazzy."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from rosidl_runtime_embedded import message_class
from rosidl_runtime_embedded.type_hash import type_hash

FACTS = Path(__file__).parents[1] / "facts"
GOLDEN: dict[str, dict[str, str]] = json.loads((FACTS / "cdr_golden.json").read_text())
FIELDS: dict[str, dict[str, str]] = json.loads((FACTS / "message_fields.json").read_text())
# computed by rosidl_generator_type_description 4.6.5 (Jazzy)
HASHES: dict[str, str] = json.loads((FACTS / "type_hashes.json").read_text())
WIRE: dict[str, str] = json.loads((FACTS / "wire_samples.json").read_text())["samples"]
ANNOUNCEMENTS = re.findall(
    r"^(PUB|SUB) \S+ (\S+) (\S+) .*typehash=(RIHS01_[0-9a-f]{64});",
    (FACTS / "discovery.txt").read_text(),
    re.MULTILINE,
)


@pytest.mark.parametrize("entry", GOLDEN.values(), ids=GOLDEN)
def test_golden_bytes_are_read_and_written_as_by_rclpy(entry: dict[str, str]) -> None:
    cls: Any = message_class(entry["type"])
    data = bytes.fromhex(entry["cdr"])
    message = cls._deserialize(data)
    assert repr(message) == entry["repr"]
    assert cls._serialize(message) == data


@pytest.mark.parametrize("name", FIELDS)
def test_fields_and_their_types_are_those_of_rclpy(name: str) -> None:
    fields = message_class(name).get_fields_and_field_types()
    assert list(fields.items()) == list(FIELDS[name].items())


@pytest.mark.parametrize("announcement", ANNOUNCEMENTS, ids=lambda announcement: " ".join(announcement[:2]))
def test_dds_names_and_type_hashes_are_the_announced_ones(
    announcement: tuple[str, str, str, str],
) -> None:
    _, _, dds_name, type_hash = announcement
    name = dds_name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")
    assert dds_name == message_class(name)._DDS_TYPE_NAME
    assert type_hash == message_class(name)._TYPE_HASH


@pytest.mark.parametrize("name", HASHES)
def test_type_hashes_are_those_that_rosidl_computes(name: str) -> None:
    assert type_hash(name) == HASHES[name]


def test_the_facts_are_complete() -> None:
    assert len(ANNOUNCEMENTS) == 24
    assert len(FIELDS) == 111
    assert len(HASHES) == 73


def test_recorded_discovery_info_survives_a_round_trip() -> None:
    cls: Any = message_class("rmw_dds_common/msg/ParticipantEntitiesInfo")
    data = bytes.fromhex(WIRE["ros_discovery_info"])
    info = cls._deserialize(data)
    (node,) = info.node_entities_info_seq
    assert (node.node_namespace, node.node_name) == ("/arm1", "facts")
    assert (len(node.reader_gid_seq), len(node.writer_gid_seq)) == (9, 13)
    assert bytes(info.gid.data).hex() == "011059c6528c327779dc351f000001c1"
    assert cls._serialize(info) == data


@pytest.mark.parametrize(
    ("topic", "name"),
    [
        ("rq/arm1/turn_onRequest", "std_srvs/srv/Trigger_Request"),
        ("rr/arm1/turn_onReply", "std_srvs/srv/Trigger_Response"),
        ("rq/arm1/facts/set_parametersRequest", "rcl_interfaces/srv/SetParameters_Request"),
        ("rr/arm1/facts/set_parametersReply", "rcl_interfaces/srv/SetParameters_Response"),
    ],
)
def test_recorded_service_calls_survive_a_round_trip(topic: str, name: str) -> None:
    cls: Any = message_class(name)
    sample = bytes.fromhex(WIRE[topic])
    data = sample[:4] + sample[20:]  # without the identity of the call
    written = cls._serialize(cls._deserialize(data))
    # DDS pads a sample to a multiple of 4 bytes
    assert written + bytes(-len(written) % 4) == data


@pytest.mark.parametrize(
    ("name", "type_hash"),
    [
        # from code that rosidl generated for std_srvs
        ("SetBool", "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"),
        ("SetBool_Event", "RIHS01_3c4c20015afb4303eafd347b1d6a786f171a89c814726961a9593ef10df878cf"),
    ],
)
def test_a_service_and_its_event_have_the_hashes_of_rosidl(name: str, type_hash: str) -> None:
    import std_srvs.srv

    assert type_hash == getattr(std_srvs.srv, name)._TYPE_HASH
