from __future__ import annotations

import copy
import math
import pickle
from array import array
from typing import Any

import numpy as np
import pytest

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, Pose, PoseWithCovariance, Quaternion
from rcl_interfaces.msg import (
    Log,
    ParameterDescriptor,
    ParameterType,
)
from rclpy.serialization import deserialize_message, serialize_message
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
from sensor_msgs.msg import Image, JointState, LaserScan, NavSatStatus
from service_msgs.msg import ServiceEventInfo
from shape_msgs.msg import MeshTriangle, SolidPrimitive
from std_msgs.msg import Byte, Empty, Float32, Float64, Header, String, UInt8MultiArray
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


def test_constants_have_the_values_of_rclpy() -> None:
    assert [DiagnosticStatus.OK, DiagnosticStatus.STALE] == [b"\0", b"\3"]
    assert Log.INFO == 20
    assert ParameterType.PARAMETER_DOUBLE == 3
    assert SolidPrimitive.PRISM == 5
    assert DiagnosticStatus().OK == b"\0"


def test_a_field_that_does_not_exist_cannot_be_set() -> None:
    with pytest.raises(AttributeError, match="dta"):
        Float64().dta = 1.0  # type: ignore[attr-defined]


def test_messages_are_equal_if_types_and_fields_are_equal() -> None:
    assert Float64(data=1.0) == Float64(data=1.0)
    assert Float64(data=1.0) != Float64(data=2.0)
    assert Float64(data=1.0) != Float32(data=1.0)
    assert Float64(data=1.0) != 1.0
    assert Float64(data=math.nan) != Float64(data=math.nan)
    assert Empty() == Empty()


def test_messages_are_unhashable_as_they_can_change() -> None:
    with pytest.raises(TypeError, match="unhashable"):
        hash(Float64())


@pytest.mark.parametrize("cls", [Float64, JointState, PoseWithCovariance])
def test_the_public_names_of_a_message_are_its_fields(cls: Any) -> None:
    # py_trees_ros, for one, lists them to its users
    public = {name for name in dir(cls) if not name.startswith("_")}
    assert public == {*cls.get_fields_and_field_types(), "SLOT_TYPES", "get_fields_and_field_types"}


def test_every_slot_of_a_message_is_set() -> None:
    for message in (
        Float64(data=1.0),
        deserialize_message(serialize_message(Float64(data=1.0)), Float64),
        Float64(data=1.0, check_fields=False),
    ):
        assert {slot: getattr(message, slot) for slot in message.__slots__} == {
            "_data": 1.0,
            "_check_fields": False,
        }
    assert Float64(check_fields=True)._check_fields is True
    assert PointStamped.__slots__ == ["_header", "_point", "_check_fields"]
    assert Empty.__slots__ == ["_check_fields"]
    assert isinstance(PoseWithCovariance()._covariance, np.ndarray)
    assert JointState(position=[1.0])._position == array("d", [1.0])
    message = String()
    message._data = "new"
    assert message.data == "new"


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


def test_a_sequence_of_numbers_is_always_an_array_array() -> None:
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
    given = array("d", [3.0])
    joints.position = given
    given.append(4.0)
    assert joints.position == array("d", [3.0])


def test_a_sequence_of_numbers_accepts_an_iterator() -> None:
    for make in (lambda: map(float, [1, 2]), lambda: (x for x in [1.0, 2.0]), lambda: reversed([2.0, 1.0])):
        scan, joints = LaserScan(ranges=make()), JointState(position=make())
        assert scan.ranges == array("f", [1.0, 2.0])
        assert joints.position == array("d", [1.0, 2.0])
        scan.ranges = make()
        assert scan.ranges == array("f", [1.0, 2.0])


def test_bytes_are_read_as_the_memory_of_a_sequence_of_numbers() -> None:
    for kind in (bytes, bytearray):
        assert LaserScan(ranges=kind(array("f", [1.0, 2.0]))).ranges == array("f", [1.0, 2.0])
        assert JointState(position=kind(array("d", [1.0, 2.0]))).position == array("d", [1.0, 2.0])


def test_an_image_accepts_bytes_and_integers_as_octets() -> None:
    for data in (b"\1\2", bytearray(b"\1\2"), memoryview(b"\1\2"), np.array([1, 2], np.uint8), [1, 2]):
        assert Image(data=data).data == array("B", [1, 2])


def test_an_array_of_numbers_is_a_numpy_array_of_its_type() -> None:
    gid = Gid(data=list(range(16)))
    assert isinstance(gid.data, np.ndarray)
    assert gid.data.dtype == np.uint8
    assert gid.data.tolist() == list(range(16))
    assert ServiceEventInfo().client_gid.tolist() == [0] * 16
    assert MeshTriangle(vertex_indices=[1, 2, 3]).vertex_indices.dtype == np.uint32
    pose = PoseWithCovariance()
    pose.covariance = np.eye(6).ravel()
    assert pose.covariance.sum() == 6.0


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
def test_slot_types_are_those_of_rosidl_parser(cls: Any, types: tuple[AbstractType, ...]) -> None:
    assert types == cls.SLOT_TYPES


def test_a_slot_type_knows_whether_its_size_is_bounded() -> None:
    number = BasicType("double")
    assert all(
        type_.has_maximum_size() for type_ in (Array(number, 2), BoundedSequence(number, 2), BoundedString(2))
    )
    assert not any(type_.has_maximum_size() for type_ in (UnboundedSequence(number), UnboundedString()))
