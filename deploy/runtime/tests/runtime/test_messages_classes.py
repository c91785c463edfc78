from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from example_interfaces.msg import Int32
from example_interfaces.srv import AddTwoInts
from geometry_msgs.msg import Point, Point32, PointStamped, PoseWithCovariance, Quaternion
from rcl_interfaces.msg import IntegerRange, Parameter, ParameterDescriptor, ParameterValue
from rmw_dds_common.msg import Gid
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import Bool, Byte, Float32, Float64, Header, Int8, String, UInt8MultiArray
from std_srvs.srv import SetBool
from visualization_msgs.msg import Marker


def test_messages_are_equal_only_if_their_arrays_are_equal() -> None:
    pose, other = PoseWithCovariance(), PoseWithCovariance()
    assert pose == other
    other.covariance[35] = 1.0
    assert pose != other
    pose.covariance[35] = 1.0
    assert pose == other


def test_an_array_of_octets_accepts_bytes() -> None:
    assert Gid(data=bytes(range(16))).data.tolist() == list(range(16))


def test_a_constructor_accepts_only_keywords_that_name_fields() -> None:
    with pytest.raises(TypeError, match="Float64"):
        Float64(1.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"Float64.*dta"):
        Float64(dta=1.0)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("values", "reason"),
    [([1.0] * 35, "35 elements"), (np.zeros((6, 6)), "2 dimensions"), ([0.0] * 37, "37 elements")],
)
def test_assigning_an_array_of_another_shape_is_an_error(values: Any, reason: str) -> None:
    with pytest.raises(
        (TypeError, ValueError), match=rf"geometry_msgs/msg/PoseWithCovariance: field 'covariance'.*{reason}"
    ):
        PoseWithCovariance().covariance = values


@pytest.mark.parametrize("values", [["1"], "12", 5, None, [None], [1.0, "x"]])
def test_assigning_other_values_to_a_numeric_sequence_is_an_error(values: Any) -> None:
    with pytest.raises(
        TypeError, match="sensor_msgs/msg/JointState: field 'position' must be sequence<double>"
    ):
        JointState(position=values)


@pytest.mark.parametrize("values", [[256], [-1], [1 << 80]])
def test_assigning_numbers_out_of_range_is_an_error(values: list[int]) -> None:
    with pytest.raises(
        ValueError, match="std_msgs/msg/UInt8MultiArray: field 'data' must be sequence<uint8>"
    ):
        UInt8MultiArray(data=values)


def test_a_float_may_be_infinite_but_not_out_of_range() -> None:
    for make in (list, iter, np.array):
        assert LaserScan(ranges=make([math.inf, -math.inf])).ranges.tolist() == [math.inf, -math.inf]
        with pytest.raises(ValueError, match=r"must be sequence<float>, .*: it has elements out of range"):
            LaserScan(ranges=make([1.0, 1e39]))


@pytest.mark.parametrize(
    ("message", "error", "reason"),
    [
        (Float64(data=1), TypeError, "std_msgs/msg/Float64: field 'data' must be double, not 1"),
        (Float64(data="x"), TypeError, "'data' must be double, not 'x'"),  # type: ignore[arg-type]
        (Float64(data=None), TypeError, "'data' must be double, not None"),  # type: ignore[arg-type]
        (Float64(data=np.float32(1)), TypeError, "'data' must be double"),  # type: ignore[arg-type]
        (Float32(data=1e39), ValueError, r"std_msgs/msg/Float32: field 'data' must be float, not 1e\+39"),
        (Bool(data=1), TypeError, "'data' must be boolean, not 1"),  # type: ignore[arg-type]
        (Int8(data=128), ValueError, r"must be int8, not 128: it must be in \[-128, 127\]"),
        (Int8(data=-129), ValueError, "must be int8, not -129"),
        (Int8(data=1.0), TypeError, "must be int8, not 1.0"),  # type: ignore[arg-type]
        (String(data=b"x"), TypeError, "std_msgs/msg/String: field 'data' must be string"),  # type: ignore[arg-type]
        (String(data="a\0b"), ValueError, "contains a NUL"),
        (String(data="\ud800"), ValueError, "surrogates not allowed"),
        (Byte(data=1), TypeError, "std_msgs/msg/Byte: field 'data' must be octet, not 1"),  # type: ignore[arg-type]
        (Byte(data=b"ab"), ValueError, "length 1"),
        (PointStamped(point=Point32()), TypeError, "field 'point' must be geometry_msgs/Point"),  # type: ignore[arg-type]
        (
            PointStamped(point=Point(y=2)),
            TypeError,
            "geometry_msgs/msg/PointStamped: field 'point.y' must be double, not 2",
        ),
        (
            PointStamped(header=Header(stamp=Time(nanosec=-1))),
            ValueError,
            "field 'header.stamp.nanosec' must be uint32",
        ),
        (DiagnosticArray(status=[DiagnosticStatus(), None]), TypeError, r"field 'status\[1\]'"),  # type: ignore[list-item]
        (
            DiagnosticArray(status=[DiagnosticStatus(values=[KeyValue(value=3)])]),  # type: ignore[arg-type]
            TypeError,
            r"diagnostic_msgs/msg/DiagnosticArray: field 'status\[0\]\.values\[0\]\.value' must be string",
        ),
        (JointState(name="ab"), TypeError, "field 'name' must be sequence<string>"),  # type: ignore[arg-type]
        (
            Parameter(value=ParameterValue(byte_array_value=[1])),  # type: ignore[list-item]
            TypeError,
            r"'value\.byte_array_value\[0\]' must be octet",
        ),
        (ParameterValue(string_array_value=b"ab"), TypeError, r"string_array_value\[0\]"),  # type: ignore[arg-type]
        (ParameterValue(bool_array_value=np.ones((2, 2), np.bool_)), TypeError, "it is not a list"),  # type: ignore[arg-type]
        (ParameterValue(bool_array_value=np.ones(2)), TypeError, r"bool_array_value\[0\]"),  # type: ignore[arg-type]
        (ParameterDescriptor(integer_range=[IntegerRange()] * 2), ValueError, "2 elements"),
    ],
)
def test_serializing_a_wrong_value_is_an_error(message: Any, error: type[Exception], reason: str) -> None:
    with pytest.raises(error, match=reason) as caught:
        type(message)._serialize(message)
    assert "\n" not in str(caught.value)
    assert caught.value.__context__ is None or caught.value.__suppress_context__


def test_serializing_a_message_of_another_type_is_an_error() -> None:
    with pytest.raises(TypeError, match=r"expected a std_msgs/msg/Float64, not std_msgs\.msg\.Float32"):
        Float64._serialize(Float32())
    with pytest.raises(TypeError, match=r"expected a std_msgs/msg/Float64, not 1\.0"):
        Float64._serialize(1.0)


def test_serializing_a_deleted_field_is_an_error() -> None:
    message = Float64()
    del message.data
    with pytest.raises(TypeError, match="field 'data' is not set"):
        Float64._serialize(message)


def test_subclasses_and_other_sequences_are_accepted_as_by_rclpy() -> None:
    def serialize(message: Any) -> bytes:
        data: bytes = type(message)._serialize(message)
        return data

    assert serialize(Float64(data=np.float64(2.0))) == serialize(Float64(data=2.0))
    assert serialize(Int8(data=True)) == serialize(Int8(data=1))
    assert serialize(JointState(name=("a", "b"))) == serialize(JointState(name=["a", "b"]))  # type: ignore[arg-type]
    assert serialize(Float32(data=math.inf))[4:] == bytes.fromhex("0000807f")
    assert math.isnan(Float64._deserialize(serialize(Float64(data=math.nan))).data)


def test_a_message_with_values_of_subclasses_is_validated_once() -> None:
    class Points(list[Point]):
        walks = 0

        def __iter__(self) -> Iterator[Point]:
            self.walks += 1
            return super().__iter__()

    exact = Marker(points=[Point(x=1.0)] * 100)
    marker = Marker(points=Points([Point(x=np.float64(1.0))] * 100))
    assert Marker._serialize(marker) == Marker._serialize(exact)
    assert marker.points.walks == 2  # type: ignore[attr-defined]


def test_a_derived_class_is_its_message_on_the_wire() -> None:
    class Length(Float64):
        def __init__(self, metres: float) -> None:
            super().__init__(data=metres)

    assert Length._serialize(Length(2.0)) == Float64._serialize(Float64(data=2.0))
    assert Length(3.0).data == 3.0
    assert Float64(data=1.0) == Float64(data=1.0)
    assert Length._TYPE_HASH == Float64._TYPE_HASH
    assert type(Length._deserialize(Length._serialize(Length(2.0)))) is Float64


def test_a_constructors_signature_shows_the_fields() -> None:
    Quaternion()
    parameters = inspect.signature(Quaternion).parameters
    assert {name: parameter.default for name, parameter in parameters.items()} == {
        "x": 0.0,
        "y": 0.0,
        "z": 0.0,
        "w": 1.0,
        "check_fields": False,
    }


def test_a_module_of_messages_lists_its_classes() -> None:
    import std_srvs.srv

    assert dir(std_srvs.srv)[:5] == ["Empty", "Empty_Event", "Empty_Request", "Empty_Response", "SetBool"]
    with pytest.raises(ImportError, match="Nothing"):
        exec("from std_srvs.srv import Nothing")
    names: dict[str, Any] = {}
    exec("from std_srvs.srv import *", names)
    assert names["SetBool"] is SetBool


def test_example_interfaces_has_messages_and_services() -> None:
    assert Int32(data=-1).data == -1
    assert AddTwoInts.Request(a=1, b=2).b == 2
