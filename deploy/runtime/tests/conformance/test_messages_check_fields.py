"""Messages that check assigned values: ``check_fields`` and ROS_PYTHON_CHECK_FIELDS, as in rclpy."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from array import array
from collections import UserList
from typing import Any

import numpy as np
import pytest

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, Point32, PointStamped, PoseWithCovariance
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor, ParameterValue
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool, Byte, Empty, Float32, Float64, Header, Int8, String
from std_srvs.srv import SetBool
from type_description_interfaces.msg import IndividualTypeDescription

WRONG = [
    (Float64, "data", 1),
    (Float64, "data", "x"),
    (Float64, "data", None),
    (Float32, "data", 1e39),
    (Bool, "data", 1),
    (Int8, "data", 128),
    (Int8, "data", 1.0),
    (String, "data", b"x"),
    (Byte, "data", 1),
    (Byte, "data", b"ab"),
    (Header, "stamp", 1.5),
    (PointStamped, "point", Point32()),
    (PointStamped, "point", None),
    (DiagnosticArray, "status", [DiagnosticStatus(), None]),
    (DiagnosticArray, "status", DiagnosticStatus()),
    (JointState, "name", "ab"),
    (JointState, "name", [b"a"]),
    (ParameterValue, "byte_array_value", b"ab"),
    (ParameterValue, "bool_array_value", [1]),
    (ParameterDescriptor, "integer_range", [IntegerRange()] * 2),
    (IndividualTypeDescription, "type_name", "x" * 256),
    (SetBool.Request, "data", "yes"),
]
ACCEPTED = [
    (Float64, "data", np.float64(1)),
    (Float32, "data", float("inf")),
    (Int8, "data", True),
    (Byte, "data", b"\1"),
    (PointStamped, "point", Point(y="only its own flag decides")),  # type: ignore[arg-type]
    (JointState, "name", ("a", "b")),
    (JointState, "name", UserList(["a"])),
    (DiagnosticArray, "status", [DiagnosticStatus(name=5)]),  # type: ignore[arg-type]
]
WRONG_NUMBERS = [
    (JointState, "position", [1]),
    (JointState, "position", ["x"]),
    (JointState, "position", 1.0),
    (JointState, "position", array("f", [1])),
    (JointState, "position", np.array([1.0])),
    (Image, "data", [256]),
    (PoseWithCovariance, "covariance", [0.0] * 35),
    (PoseWithCovariance, "covariance", [0] * 36),
    (PoseWithCovariance, "covariance", np.zeros(37)),
    (PoseWithCovariance, "covariance", np.zeros(36, np.float32)),
]
ACCEPTED_NUMBERS = [
    (JointState, "position", [1.0]),
    (JointState, "position", {1.0}),
    (JointState, "position", array("d", [1])),
    (Image, "data", b"ab"),
    (PoseWithCovariance, "covariance", np.ones(36)),
    (PoseWithCovariance, "covariance", array("d", range(36))),
]


def assert_assignment_is_refused(cls: Any, field: str, value: Any) -> None:
    """A message that checks fields refuses this value and keeps its old one."""
    message = cls(check_fields=True)
    with pytest.raises(AssertionError, match=f"'{field}"):
        setattr(message, field, value)
    assert message == cls()


@pytest.mark.filterwarnings("ignore:.*ByteString")  # of ROS 2's messages on Python 3.12 and newer
@pytest.mark.parametrize(("cls", "field", "value"), WRONG)
def test_a_message_that_checks_fields_refuses_a_wrong_value(cls: Any, field: str, value: Any) -> None:
    with pytest.raises(AssertionError, match=f"'{field}"):
        cls(check_fields=True, **{field: value})
    assert_assignment_is_refused(cls, field, value)


@pytest.mark.parametrize(("cls", "field", "value"), ACCEPTED)
def test_a_message_that_checks_fields_accepts_fitting_values(cls: Any, field: str, value: Any) -> None:
    message = cls(check_fields=True, **{field: value})
    setattr(message, field, value)
    assert getattr(message, field) == value


@pytest.mark.parametrize(("cls", "field", "value"), WRONG_NUMBERS)
def test_wrong_numbers_are_refused_at_assignment(cls: Any, field: str, value: Any) -> None:
    assert_assignment_is_refused(cls, field, value)


@pytest.mark.parametrize(("cls", "field", "value"), ACCEPTED_NUMBERS)
def test_fitting_numbers_are_accepted(cls: Any, field: str, value: Any) -> None:
    message = cls(check_fields=True)
    setattr(message, field, value)
    assert list(getattr(message, field)) == list(value)


def test_a_constructor_converts_numbers_before_they_are_checked() -> None:
    for values in ([1, 2], np.array([1, 2]), range(1, 3)):
        joints = JointState(position=values, check_fields=True)
        assert joints.position == array("d", [1, 2])


@pytest.mark.parametrize(("cls", "field", "value"), WRONG)
def test_other_messages_accept_any_value(cls: Any, field: str, value: Any) -> None:
    earlier = cls()
    cls(check_fields=True)
    for message in (earlier, cls(), cls(check_fields=False), cls(**{field: value})):
        setattr(message, field, value)
        assert getattr(message, field) is value


def test_a_message_that_checks_fields_behaves_like_any_other() -> None:
    message = PointStamped(header=Header(stamp=Time(sec=1)), point=Point(x=2.0), check_fields=True)
    assert message == PointStamped(header=Header(stamp=Time(sec=1)), point=Point(x=2.0))
    assert type(message) is PointStamped
    assert repr(message) == repr(copy.copy(message))
    assert deserialize_message(serialize_message(message), PointStamped) == message
    message.point.x = 5  # only its own flag decides
    assert Empty(check_fields=True) == Empty()


def test_a_copy_checks_fields_if_its_original_does() -> None:
    message = Float64(data=1.0, check_fields=True)
    for twin in (copy.copy(message), copy.deepcopy(message), pickle.loads(pickle.dumps(message))):
        assert twin == message
        with pytest.raises(AssertionError):
            twin.data = 1


def test_a_class_derived_from_a_message_can_check_fields() -> None:
    class Length(Float64):
        def __init__(self, metres: float) -> None:
            super().__init__(data=metres, check_fields=True)

    with pytest.raises(AssertionError):
        Length(2)
    assert Length(2.0).data == 2.0


@pytest.mark.parametrize(("variable", "checks"), [("1", True), ("0", False), ("true", False), ("", False)])
def test_an_environment_variable_makes_all_messages_check_fields(variable: str, checks: bool) -> None:
    code = f"""
from pytest import raises
from rclpy.serialization import deserialize_message, serialize_message
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

assert JointState(position=[1, 2]).position.tolist() == [1.0, 2.0]
received = deserialize_message(serialize_message(PointStamped()), PointStamped)
for message in (Float64(), received.point, PointStamped().point):
    for name in {{"data", "x"}} & set(message.get_fields_and_field_types()):
        if {checks}:
            with raises(AssertionError):
                setattr(message, name, 1)
        else:
            setattr(message, name, 1)
String(check_fields=False).data = 1
with raises(AssertionError):
    String(data=1, check_fields=True)
"""
    subprocess.run(
        [sys.executable, "-c", code], check=True, env={**os.environ, "ROS_PYTHON_CHECK_FIELDS": variable}
    )
