"""Message types against those of ROS 2 Jazzy: its wheels, and what was recorded from an installed one."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

import rosidl_runtime_embedded
from rosidl_runtime_embedded import message_class
from rosidl_runtime_embedded.type_hash import describe, type_hash

FACTS = Path(__file__).parents[1] / "facts"
GOLDEN: dict[str, dict[str, str]] = json.loads((FACTS / "cdr_golden.json").read_text())
# of the types that the wheels lack, computed by rosidl_generator_type_description 4.6.5 (Jazzy)
HASHES: dict[str, str] = json.loads((FACTS / "type_hashes.json").read_text())
WIRE: dict[str, str] = json.loads((FACTS / "wire_samples.json").read_text())["samples"]
SOURCE = Path(rosidl_runtime_embedded.__file__).parents[1]
DESCRIPTIONS = [
    path for path in Path(sys.prefix, "share").glob("*/*/*.json") if (SOURCE / path.parts[-3]).is_dir()
]


@pytest.mark.parametrize("entry", GOLDEN.values(), ids=GOLDEN)
def test_golden_bytes_are_read_and_written_as_by_rclpy(entry: dict[str, str]) -> None:
    cls: Any = message_class(entry["type"])
    data = bytes.fromhex(entry["cdr"])
    message = cls._deserialize(data)
    assert repr(message) == entry["repr"]
    assert cls._serialize(message) == data


@pytest.mark.skipif(not DESCRIPTIONS, reason="platform: PyPI has no messages of ROS 2 for this machine")
@pytest.mark.parametrize("path", DESCRIPTIONS, ids=lambda path: "/".join(path.parts[-3:]))
def test_fields_defaults_and_hashes_are_those_of_the_wheels(path: Path) -> None:
    expected = json.loads(path.read_text())
    description, referenced = describe("/".join((*path.parts[-3:-1], path.stem)))
    assert expected["type_description_msg"] == {
        "type_description": description,
        "referenced_type_descriptions": referenced,
    }
    for each in expected["type_hashes"]:
        assert type_hash(each["type_name"]) == each["hash_string"]


@pytest.mark.parametrize("name", HASHES)
def test_type_hashes_are_those_that_rosidl_computes(name: str) -> None:
    assert type_hash(name) == HASHES[name]


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
