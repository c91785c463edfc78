"""Message classes of the embedded runtime: values, defaults, errors – as rclpy's."""

from __future__ import annotations

import copy
import inspect
import math
import pickle
import subprocess
import sys
from array import array
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Point32, PointStamped, Pose, PoseWithCovariance, Quaternion
from rcl_interfaces.msg import (
    IntegerRange,
    Log,
    Parameter,
    ParameterDescriptor,
    ParameterType,
    ParameterValue,
)
from rmw_dds_common.msg import Gid
from rosidl_parser.definition import (
    AbstractType,
    Array,
    BasicType,
    BoundedSequence,
    BoundedString,
    NamespacedType,
    UnboundedSequence,
    UnboundedString,
)
from rosidl_runtime_embedded import Message
from sensor_msgs.msg import Image, JointState, NavSatStatus
from service_msgs.msg import ServiceEventInfo
from shape_msgs.msg import MeshTriangle, SolidPrimitive
from std_msgs.msg import Bool, Byte, Empty, Float32, Float64, Header, Int8, String, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger
from type_description_interfaces.srv import GetTypeDescription


def test_a_new_message_has_the_default_values_of_its_definition() -> None:
    assert Quaternion() == Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    assert Pose().orientation.w == 1.0
    assert NavSatStatus().status == -2
    assert GetTypeDescription.Request().include_type_sources is True
    assert ParameterDescriptor().read_only is False
    assert Byte().data == b"\0"
    assert Time() == Time(sec=0, nanosec=0)
    assert (Quaternion.X__DEFAULT, Quaternion.W__DEFAULT) == (0.0, 1.0)


def test_nested_defaults_are_not_shared_between_messages() -> None:
    first, second = PointStamped(), PointStamped()
    first.point.x = 1.0
    first.header.stamp.sec = 7
    assert second == PointStamped()
    assert first != second

    status = DiagnosticStatus()
    status.values.append(KeyValue(key="a"))
    assert DiagnosticStatus().values == []

    joints = JointState()
    joints.position.append(1.0)
    assert JointState().position == array("d")

    pose = PoseWithCovariance()
    pose.covariance[0] = 1.0
    assert pose.covariance[0] == 1.0
    assert not PoseWithCovariance().covariance.any()


def test_constants_are_attributes_with_the_values_of_rclpy() -> None:
    assert [DiagnosticStatus.OK, DiagnosticStatus.STALE] == [b"\0", b"\3"]
    assert Log.INFO == 20
    assert ParameterType.PARAMETER_DOUBLE == 3
    assert SolidPrimitive.PRISM == 5
    assert DiagnosticStatus().OK == b"\0"


def test_a_constructor_takes_keywords_only_and_refuses_what_is_no_field() -> None:
    with pytest.raises(TypeError, match="Float64"):
        Float64(1.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"Float64.*dta"):
        Float64(dta=1.0)  # type: ignore[call-arg]


def test_a_field_that_does_not_exist_cannot_be_set() -> None:
    with pytest.raises(AttributeError, match="dta"):
        Float64().dta = 1.0  # type: ignore[attr-defined]


def test_messages_are_equal_if_their_types_and_fields_are() -> None:
    assert Float64(data=1.0) == Float64(data=1.0)
    assert Float64(data=1.0) != Float64(data=2.0)
    assert Float64(data=1.0) != Float32(data=1.0)
    assert Float64(data=1.0) != 1.0
    assert Float64(data=math.nan) != Float64(data=math.nan)
    assert Empty() == Empty()

    pose, other = PoseWithCovariance(), PoseWithCovariance()
    assert pose == other
    other.covariance[35] = 1.0
    assert pose != other
    pose.covariance[35] = 1.0
    assert pose == other


def test_messages_are_unhashable_as_they_can_change() -> None:
    with pytest.raises(TypeError, match="unhashable"):
        hash(Float64())


def test_messages_survive_copy_and_pickle() -> None:
    pose = PoseWithCovariance(covariance=range(36))
    joints = JointState(header=Header(frame_id="base"), name=["a"], position=[1.5])
    for message in (pose, joints, Empty(), Trigger.Response(message="ok")):
        assert copy.copy(message) == message
        assert copy.deepcopy(message) == message
        assert pickle.loads(pickle.dumps(message)) == message
    twin = copy.deepcopy(joints)
    twin.header.frame_id = "tool"
    twin.position[0] = 2.0
    assert (joints.header.frame_id, joints.position[0]) == ("base", 1.5)


def test_a_sequence_of_numbers_is_an_array_array_whatever_was_assigned() -> None:
    joints = JointState()
    for values in (
        [1.0, 2.0],
        (1, 2),
        array("f", [1, 2]),
        np.array([1.0, 2.0]),
        np.array([1, 2]),
        range(1, 3),
    ):
        joints.position = values
        assert joints.position == array("d", [1.0, 2.0])
        assert joints.position.typecode == "d"
    kept = array("d", [3.0])
    joints.position = kept
    assert joints.position is kept


def test_bytes_are_a_sequence_of_octets_of_an_image() -> None:
    for data in (b"\1\2", bytearray(b"\1\2"), memoryview(b"\1\2"), np.array([1, 2], np.uint8), [1, 2]):
        assert Image(data=data).data == array("B", [1, 2])


def test_an_array_of_numbers_is_a_numpy_array_of_the_fields_type() -> None:
    gid = Gid(data=bytes(range(16)))
    assert isinstance(gid.data, np.ndarray)
    assert gid.data.dtype == np.uint8
    assert gid.data.tolist() == list(range(16))
    assert ServiceEventInfo().client_gid.tolist() == [0] * 16
    assert MeshTriangle(vertex_indices=[1, 2, 3]).vertex_indices.dtype == np.uint32
    pose = PoseWithCovariance()
    pose.covariance = np.eye(6).ravel()
    assert pose.covariance.sum() == 6.0


@pytest.mark.parametrize(
    ("values", "reason"),
    [([1.0] * 35, "35 elements"), (np.zeros((6, 6)), "2 dimensions"), ([0.0] * 37, "37 elements")],
)
def test_an_array_of_another_shape_is_refused_when_it_is_assigned(values: Any, reason: str) -> None:
    with pytest.raises(
        (TypeError, ValueError), match=rf"geometry_msgs/msg/PoseWithCovariance: field 'covariance'.*{reason}"
    ):
        PoseWithCovariance().covariance = values


@pytest.mark.parametrize("values", [["1"], "12", 5, None, [None], [1.0, "x"]])
def test_what_is_no_sequence_of_numbers_is_refused_when_it_is_assigned(values: Any) -> None:
    with pytest.raises(
        TypeError, match="sensor_msgs/msg/JointState: field 'position' must be sequence<double>"
    ):
        JointState(position=values)


@pytest.mark.parametrize("values", [[256], [-1], [1 << 80]])
def test_numbers_out_of_range_are_refused_when_they_are_assigned(values: list[int]) -> None:
    with pytest.raises(
        ValueError, match="std_msgs/msg/UInt8MultiArray: field 'data' must be sequence<uint8>"
    ):
        UInt8MultiArray(data=values)


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
        (Parameter(value=ParameterValue(byte_array_value=b"ab")), TypeError, "byte_array_value"),  # type: ignore[arg-type]
        (ParameterDescriptor(integer_range=[IntegerRange()] * 2), ValueError, "2 elements"),
    ],
)
def test_a_wrong_value_is_refused_when_the_message_is_serialized(
    message: Any, error: type[Exception], reason: str
) -> None:
    with pytest.raises(error, match=reason) as caught:
        type(message)._serialize(message)
    assert "\n" not in str(caught.value)
    assert caught.value.__context__ is None or caught.value.__suppress_context__


def test_a_message_of_another_type_is_refused() -> None:
    with pytest.raises(TypeError, match=r"a std_msgs/msg/Float64 is expected, not std_msgs\.msg\.Float32"):
        Float64._serialize(Float32())
    with pytest.raises(TypeError, match=r"expected, not 1\.0"):
        Float64._serialize(1.0)


def test_a_field_that_was_deleted_is_reported() -> None:
    message = Float64()
    del message.data
    with pytest.raises(TypeError, match="field 'data' is not set"):
        Float64._serialize(message)


def test_values_of_subclasses_and_other_sequences_are_accepted_as_by_rclpy() -> None:
    def serialize(message: Any) -> bytes:
        data: bytes = type(message)._serialize(message)
        return data

    assert serialize(Float64(data=np.float64(2.0))) == serialize(Float64(data=2.0))
    assert serialize(Int8(data=True)) == serialize(Int8(data=1))
    assert serialize(JointState(name=("a", "b"))) == serialize(JointState(name=["a", "b"]))  # type: ignore[arg-type]
    assert serialize(Float32(data=math.inf))[4:] == bytes.fromhex("0000807f")
    assert math.isnan(Float64._deserialize(serialize(Float64(data=math.nan))).data)


def test_a_service_has_three_messages_and_no_instances() -> None:
    assert repr(Trigger.Response(success=True)) == "std_srvs.srv.Trigger_Response(success=True, message='')"
    assert SetBool.Request.get_fields_and_field_types() == {"data": "boolean"}
    assert SetBool.Event.get_fields_and_field_types() == {
        "info": "service_msgs/ServiceEventInfo",
        "request": "sequence<std_srvs/SetBool_Request, 1>",
        "response": "sequence<std_srvs/SetBool_Response, 1>",
    }
    with pytest.raises(NotImplementedError, match="can not be instantiated"):
        SetBool()


def test_a_class_derived_from_a_message_is_that_message_on_the_wire() -> None:
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


@pytest.mark.parametrize(
    ("cls", "types"),
    [
        (Empty, ()),
        (Header, (NamespacedType(["builtin_interfaces", "msg"], "Time"), UnboundedString())),
        (Gid, (Array(BasicType("uint8"), 16),)),
        (
            UInt8MultiArray,
            (NamespacedType(["std_msgs", "msg"], "MultiArrayLayout"), UnboundedSequence(BasicType("uint8"))),
        ),
        (
            SetBool.Event,
            (
                NamespacedType(["service_msgs", "msg"], "ServiceEventInfo"),
                BoundedSequence(NamespacedType(["std_srvs", "srv"], "SetBool_Request"), 1),
                BoundedSequence(NamespacedType(["std_srvs", "srv"], "SetBool_Response"), 1),
            ),
        ),
    ],
)
def test_a_class_tells_the_types_of_its_fields_as_rosidl_parser_does(
    cls: type[Message], types: tuple[AbstractType, ...]
) -> None:
    assert types == cls.SLOT_TYPES


def test_a_type_tells_whether_its_size_is_bounded() -> None:
    number = BasicType("double")
    assert all(
        type_.has_maximum_size() for type_ in (Array(number, 2), BoundedSequence(number, 2), BoundedString(2))
    )
    assert not any(type_.has_maximum_size() for type_ in (UnboundedSequence(number), UnboundedString()))


def test_a_module_of_messages_lists_its_classes() -> None:
    import std_srvs.srv

    assert dir(std_srvs.srv)[:5] == ["Empty", "Empty_Event", "Empty_Request", "Empty_Response", "SetBool"]
    with pytest.raises(ImportError, match="Nothing"):
        exec("from std_srvs.srv import Nothing")
    names: dict[str, Any] = {}
    exec("from std_srvs.srv import *", names)
    assert names["SetBool"] is SetBool


def test_messages_of_numbers_need_no_numpy() -> None:
    code = (
        "import sys; from rmw_dds_common.msg import Gid; from sensor_msgs.msg import Imu\n"
        "Imu._deserialize(Imu._serialize(Imu())); Gid._serialize(Gid(data=bytes(16)))\n"
        "assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
