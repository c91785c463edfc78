"""Codecs: against rosbags, an independent implementation, and against malformed input."""

from __future__ import annotations

import itertools
import math
import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import rosidl_runtime_embedded
from rosidl_runtime_embedded import message_class
from rosidl_runtime_embedded.definition import FieldType, integer_range
from rosidl_runtime_embedded.definition_files import definition_source, interface_names, message_definition
from rosidl_runtime_embedded.fields import ARRAY_CODES

from .fuzz import MAIN_TYPES, feed

SOURCE = Path(rosidl_runtime_embedded.__file__).parents[1]
PACKAGES = sorted({path.parents[1].name for path in SOURCE.glob("*/msg/*.msg")})
MESSAGES = [
    f"{package}/msg/{name}"
    for package in PACKAGES
    for name in interface_names(package, "msg")
    if name != "WString"  # rosbags has no wide strings
]
STORE = get_typestore(Stores.ROS2_JAZZY)
for _name in MESSAGES:
    if _name not in STORE.types:
        STORE.register(get_types_from_msg(definition_source(_name)[1], _name))
NUMBERS = itertools.count()


def elements(type_: FieldType) -> st.SearchStrategy[Any]:
    if type_.is_message:
        return messages(type_.base)
    if type_.base in ("float", "double"):
        return st.floats(width=32 if type_.base == "float" else 64, allow_nan=False)
    if type_.base == "boolean":
        return st.booleans()
    if type_.base == "octet":
        return st.binary(min_size=1, max_size=1)
    if type_.base in ("string", "wstring"):
        characters = st.characters(codec="utf-8", exclude_characters="\0")
        return st.text(characters, max_size=type_.string_bound or 8)
    low, high = integer_range(type_.base)
    return st.integers(low, high)


def messages(name: str) -> st.SearchStrategy[Any]:
    fields = {}
    for field in message_definition(name).fields:
        size = field.type.array_size
        values = elements(field.type)
        if field.type.is_plural:
            values = st.lists(values, min_size=size, max_size=size or field.type.sequence_bound or 3)
        fields[field.name] = values
    return st.builds(message_class(name), **fields)


def as_rosbags(message: Any) -> Any:
    cls = STORE.types[message._TYPE_NAME]
    values = {}
    for field in message._DEFINITION.fields:
        value, base = getattr(message, field.name), field.type.base
        if field.type.is_message:
            value = [as_rosbags(element) for element in value] if field.type.is_plural else as_rosbags(value)
        elif base == "octet":
            value = (
                np.array([byte[0] for byte in value], np.uint8)
                if field.type.is_plural
                else int.from_bytes(value, signed=True)
            )
        elif field.type.is_plural and base == "boolean":
            value = np.array(value, np.bool_)
        elif field.type.is_plural and base in ARRAY_CODES:
            value = np.array(value, ARRAY_CODES[base])
        values[field.name] = value
    return cls(**values)


@pytest.mark.parametrize("name", MESSAGES)
@settings(max_examples=6, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_any_message_is_written_as_by_rosbags_and_read_back(name: str, data: st.DataObject) -> None:
    message = data.draw(messages(name))
    cls: Any = type(message)
    written = cls._serialize(message)
    assert written == bytes(STORE.serialize_cdr(as_rosbags(message), name))
    assert cls._deserialize(written) == message
    assert cls._deserialize(memoryview(written)) == message
    assert cls._deserialize(written + b"\0\0\0") == message


@pytest.mark.parametrize("name", MAIN_TYPES)
@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_every_truncation_of_a_sample_is_refused(name: str, data: st.DataObject) -> None:
    message = data.draw(messages(name))
    cls: Any = type(message)
    written = cls._serialize(message)
    # A message is dear to draw: each one is truncated at several places.
    for shorter in data.draw(st.lists(st.integers(0, len(written) - 1), min_size=8, max_size=8)):
        with pytest.raises(ValueError, match=f"{shorter} bytes are not a valid {name}: "):
            cls._deserialize(written[:shorter])
        with pytest.raises(ValueError, match=f"{shorter} bytes are not a valid {name}: "):
            cls._deserialize(memoryview(written)[:shorter])


@pytest.mark.parametrize("header", ["00000000", "00020000", "00030000", "01000000", "00070000", "ffff0000"])
def test_headers_other_than_little_endian_cdr_are_refused(header: str) -> None:
    with pytest.raises(ValueError, match="header"):
        message_class("std_msgs/msg/Float64")._deserialize(bytes.fromhex(header) + bytes(8))


def test_options_in_the_header_are_ignored() -> None:
    cls: Any = message_class("std_msgs/msg/Float64")
    assert cls._deserialize(bytes.fromhex("00010003") + bytes(8)) == cls()


@pytest.mark.parametrize("value", [2, 128, 255])
def test_a_bool_that_is_neither_true_nor_false_is_refused(value: int) -> None:
    with pytest.raises(ValueError, match="bool"):
        message_class("std_msgs/msg/Bool")._deserialize(bytes((0, 1, 0, 0, value)))
    sample = bytes((0, 1, 0, 0)) + bytes(4 * 8) + struct.pack("<IB", 1, value)
    with pytest.raises(ValueError, match="a bool is neither 0 nor 1"):
        message_class("rcl_interfaces/msg/ParameterValue")._deserialize(sample)


PRIMITIVES = ["bool", "byte", "char", "float32", "float64", "string"] + [
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
]
PLURALS = st.sampled_from(["", "", "", "[]", "[<=2]", "[1]", "[3]"])


def definitions(bases: list[str]) -> st.SearchStrategy[str]:
    types = st.lists(st.builds(str.__add__, st.sampled_from(bases), PLURALS), max_size=6)
    return types.map(lambda types: "".join(f"{type_} field{n}\n" for n, type_ in enumerate(types)))


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        path = tmp_path_factory.mktemp("prefix")
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(path))
        yield path


@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_messages_of_any_definition_are_written_as_by_rosbags(data: st.DataObject, prefix: Path) -> None:
    # unique names for each example, because types are cached
    number = next(NUMBERS)
    directory = prefix / "share" / "any_msgs" / "msg"
    directory.mkdir(parents=True, exist_ok=True)
    bases = PRIMITIVES
    for level in "ABC":
        name = f"{level}{number}"
        text = data.draw(definitions(bases))
        (directory / f"{name}.msg").write_text(text)
        STORE.register(get_types_from_msg(text, f"any_msgs/msg/{name}"))
        bases = [*bases, name, name, name]

    message = data.draw(messages(f"any_msgs/msg/{name}"))
    cls: Any = type(message)
    written = cls._serialize(message)
    assert written == bytes(STORE.serialize_cdr(as_rosbags(message), message._TYPE_NAME))
    assert cls._deserialize(written) == message
    if "char" not in "".join(path.read_text() for path in directory.glob(f"?{number}.msg")):
        assert STORE.hash_rihs01(message._TYPE_NAME) == cls._TYPE_HASH
    feed(message._TYPE_NAME, 200, str(number))


def string_sample(*data: int) -> bytes:
    return bytes((0, 1, 0, 0)) + struct.pack("<I", len(data)) + bytes(data)


def test_strings_are_read_as_rclpy_reads_them() -> None:
    cls: Any = message_class("std_msgs/msg/String")
    assert cls._deserialize(string_sample()).data == ""
    assert cls._deserialize(string_sample(0)).data == ""
    assert cls._deserialize(string_sample(0x61, 0xFF, 0x62, 0)).data == "a\ufffdb"
    assert cls._deserialize(string_sample(0x61, 0, 0x62, 0)).data == "a"
    with pytest.raises(ValueError, match="not terminated"):
        cls._deserialize(string_sample(0x61, 0x62))


@pytest.mark.parametrize("count", [2, 1000, 0x7FFFFFFF, 0xFFFFFFFF])
def test_a_count_beyond_the_end_of_the_sample_is_refused_at_once(count: int) -> None:
    claim = bytes((0, 1, 0, 0)) + struct.pack("<I", count)
    header = bytes((0, 1, 0, 0)) + struct.pack("<iIIxxxx", 0, 0, 1)
    for name, sample in {
        "std_msgs/msg/String": claim,
        "geometry_msgs/msg/Polygon": claim,
        "rcl_interfaces/srv/GetParameters_Request": claim,
        "rcl_interfaces/srv/GetParameterTypes_Response": claim,
        "diagnostic_msgs/msg/DiagnosticArray": header + struct.pack("<I", count),
        "sensor_msgs/msg/LaserEcho": claim,
        "std_msgs/msg/ByteMultiArray": claim,
    }.items():
        with pytest.raises(ValueError, match=name):
            message_class(name)._deserialize(sample)


def test_string_bounds_are_checked_only_if_messages_check_fields() -> None:
    code = (
        "from type_description_interfaces.msg import IndividualTypeDescription as Description\n"
        "data = bytes.fromhex('00010000 04010000') + b'x' * 259 + bytes(5)\n"
        "assert len(Description._deserialize(data).type_name) == 259"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    checked = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "ROS_PYTHON_CHECK_FIELDS": "1"},
        capture_output=True,
        text=True,
    )
    assert "ValueError: 272 bytes are not a valid type_description_interfaces/msg/Indiv" in checked.stderr


def test_a_sequence_longer_than_its_bound_is_refused() -> None:
    cls: Any = message_class("rcl_interfaces/msg/ParameterDescriptor")
    sample = bytearray(cls._serialize(cls()))
    sample[-4:] = struct.pack("<I", 2)  # integer_range, the last field
    with pytest.raises(ValueError, match="too long"):
        cls._deserialize(bytes(sample) + bytes(64))


def test_wide_strings_are_utf_16_code_units_of_4_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    directory = tmp_path / "share" / "wide_msgs" / "msg"
    directory.mkdir(parents=True)
    (directory / "Wide.msg").write_text("wstring text\nwstring[] texts\nuint8 last\n")
    cls: Any = message_class("wide_msgs/msg/Wide")
    message = cls(text="aż\U0001f600", texts=["", "\0"], last=7)
    units = struct.pack("<IIIII", 4, 0x61, 0x17C, 0xD83D, 0xDE00)
    expected = bytes((0, 1, 0, 0)) + units + struct.pack("<IIIIB", 2, 0, 1, 0, 7)
    assert cls._serialize(message) == expected
    assert cls._deserialize(expected) == message
    for unit in (0x10000, 0xD83D):
        with pytest.raises(ValueError, match="wide_msgs/msg/Wide"):
            cls._deserialize(bytes((0, 1, 0, 0)) + struct.pack("<IIIB", 1, unit, 0, 0))
    with pytest.raises(ValueError, match="field 'text'"):
        cls._serialize(cls(text="\ud800"))


def test_nan_and_infinity_survive_a_round_trip() -> None:
    cls: Any = message_class("geometry_msgs/msg/Point")
    point = cls._deserialize(cls._serialize(cls(x=math.nan, y=math.inf, z=-math.inf)))
    assert math.isnan(point.x)
    assert (point.y, point.z) == (math.inf, -math.inf)
