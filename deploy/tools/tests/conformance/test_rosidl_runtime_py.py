"""rosidl_runtime_py: messages as YAML, CSV and dictionaries, fields from plain values, interfaces by name."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, PoseWithCovariance, TwistStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, JointState
from std_msgs.msg import Bool, Byte, ByteMultiArray, Float32, Float64, Header, String, UInt8MultiArray
from std_srvs.srv import SetBool

from rosidl_runtime_py import (
    get_action_interfaces,
    get_interface_path,
    get_message_interfaces,
    get_service_interfaces,
    message_to_csv,
    message_to_yaml,
    set_message_fields,
)
from rosidl_runtime_py.convert import message_to_ordereddict
from rosidl_runtime_py.utilities import get_action, get_message, get_service

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:  # ROS 2's wheels
    from test_msgs.action import Fibonacci

PACKAGE = Fibonacci.__module__.partition(".")[0]

STATUS = DiagnosticStatus(
    level=b"\x01", name="arm", message="slow: yes", values=[KeyValue(key="a", value="1"), KeyValue()]
)


@pytest.mark.parametrize(
    ("message", "yaml"),
    [
        (Float64(data=0.1), "data: 0.1\n"),
        (Bool(data=True), "data: true\n"),
        (String(data="héllo"), "data: héllo\n"),
        (String(), "data: ''\n"),
        (Byte(data=b"\x07"), 'data: "\\a"\n'),
        (Float32(data=0.5), "data: 0.5\n"),
        (
            PointStamped(header=Header(frame_id="base")),
            "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: base\n"
            "point:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n",
        ),
        (
            JointState(name=["a", "b"], position=[1.0, 2.5]),
            "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: ''\n"
            "name:\n- a\n- b\nposition:\n- 1.0\n- 2.5\nvelocity: []\neffort: []\n",
        ),
        (
            STATUS,
            "level: \"\\x01\"\nname: arm\nmessage: 'slow: yes'\nhardware_id: ''\n"
            "values:\n- key: a\n  value: '1'\n- key: ''\n  value: ''\n",
        ),
    ],
)
def test_yaml_of_messages(message: Any, yaml: str) -> None:
    assert message_to_yaml(message) == yaml


def test_flow_style_writes_arrays_in_one_line() -> None:
    joints = message_to_yaml(JointState(name=["a", "b"]), flow_style=True)
    assert joints.endswith("name: [a, b]\nposition: []\nvelocity: []\neffort: []\n")
    status = message_to_yaml(DiagnosticStatus(values=[KeyValue(key="a")]), flow_style=True)
    assert status.endswith("values: [{key: a, value: ''}]\n")


def test_long_strings_and_arrays_are_cut() -> None:
    message = JointState(name=["abcdef", "b", "c"], position=[1.0, 2.0, 3.0])
    cut = message_to_ordereddict(message, truncate_length=2)
    assert cut["name"] == ["ab...", "b", "..."]
    assert cut["position"] == [1.0, 2.0, "..."]
    assert message_to_csv(message, truncate_length=2) == "0,0,,ab...,b,...,1.0,2.0,...,,"


def test_summaries_replace_arrays_and_strings() -> None:
    message = JointState(name=["a", "b"], position=[1.0], header=Header(frame_id="base"))
    shown = message_to_ordereddict(message, no_arr=True, no_str=True)
    assert shown["name"] == "<sequence type: string, length: 2>"
    assert shown["position"] == "<sequence type: double, length: 1>"
    assert shown["header"]["frame_id"] == "<string length: <4>>"
    camera = message_to_ordereddict(CameraInfo(), no_arr=True)
    assert camera["k"] == "<array type: double[9]>"
    status = message_to_ordereddict(DiagnosticArray(status=[STATUS]), no_arr=True)
    assert status["status"] == "<sequence type: diagnostic_msgs/msg/DiagnosticStatus, length: 1>"
    assert message_to_csv(message, no_arr=True, no_str=True).startswith("0,0,<string length: <4>>,<sequence")


def test_dictionary_holds_plain_values_in_the_order_of_fields() -> None:
    pose = message_to_ordereddict(PoseWithCovariance())
    assert list(pose) == ["pose", "covariance"]
    assert isinstance(pose["pose"], OrderedDict)
    assert pose["covariance"] == [0.0] * 36
    assert {type(value) for value in pose["covariance"]} == {float}
    assert message_to_ordereddict(UInt8MultiArray(data=[1, 255]))["data"] == [1, 255]
    assert message_to_ordereddict(ByteMultiArray(data=[b"\x01", b"\xff"]))["data"] == ["\x01", "\xff"]


def test_csv_of_messages() -> None:
    assert message_to_csv(PointStamped(header=Header(frame_id="base"))) == "0,0,base,0.0,0.0,0.0"
    assert message_to_csv(CompressedImage(format="png", data=[1, 2])) == "0,0,,png,1,2"
    assert message_to_csv(STATUS) == "b'\\x01',arm,slow: yes,,a,1,"


def test_fields_are_set_from_plain_values() -> None:
    message = PointStamped()
    assert set_message_fields(message, {"header": {"frame_id": "base"}, "point": {"x": 1}}) == []
    assert message.header.frame_id == "base"
    assert message.point.x == 1.0
    joints = JointState()
    set_message_fields(joints, {"name": ["a"], "position": [1.5, 2.5]})
    assert joints == JointState(name=["a"], position=[1.5, 2.5])
    array = DiagnosticArray()
    set_message_fields(array, {"status": [{"name": "arm", "values": [{"key": "a"}]}]})
    assert array.status[0].values == [KeyValue(key="a")]
    camera = CameraInfo()
    set_message_fields(camera, {"k": [1.0] * 9})
    assert list(camera.k) == [1.0] * 9
    text = String()
    set_message_fields(text, {"data": 5})
    assert text.data == "5"


def test_auto_and_now_are_set_later() -> None:
    header = TwistStamped()
    (set_stamp,) = set_message_fields(header, {"header": "auto"}, expand_header_auto=True)
    set_stamp(Time(sec=7))
    assert header.header.stamp.sec == 7
    stamp = PointStamped()
    (set_stamp,) = set_message_fields(stamp, {"header": {"stamp": "now"}}, expand_time_now=True)
    set_stamp(Time(sec=8))
    assert stamp.header.stamp.sec == 8


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ({"nothing": 1}, AttributeError),
        ({"header": 5}, TypeError),
        ({"header": "auto"}, TypeError),
        ([], TypeError),
        ({"point": {"x": "text"}}, ValueError),
    ],
)
def test_values_that_do_not_fit_are_errors(values: Any, error: type[Exception]) -> None:
    with pytest.raises(error):
        set_message_fields(PointStamped(), values)


@pytest.mark.parametrize("name", ["std_msgs/msg/String", "std_msgs/String"])
def test_messages_by_name(name: str) -> None:
    assert get_message(name) is String


def test_message_of_the_feedback_of_an_action_by_name() -> None:
    assert get_message(f"{PACKAGE}/action/Fibonacci_FeedbackMessage") is Fibonacci.Impl.FeedbackMessage


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("nothing/msg/String", ModuleNotFoundError),
        ("std_msgs/msg/Nothing", AttributeError),
        ("std_srvs/srv/SetBool", ValueError),
        ("String", ValueError),
    ],
)
def test_unknown_messages_are_errors(name: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        get_message(name)


def test_services_and_actions_by_name() -> None:
    assert get_service("std_srvs/SetBool") is SetBool
    assert get_action(f"{PACKAGE}/Fibonacci") is Fibonacci
    with pytest.raises(ValueError, match="Expected the full name of a service, got 'std_msgs/msg/String'"):
        get_service("std_msgs/msg/String")
    with pytest.raises(ValueError, match="Expected the full name of an action, got"):
        get_action("std_srvs/srv/SetBool")


def test_interfaces_of_packages_are_listed() -> None:
    assert "msg/String" in get_message_interfaces()["std_msgs"]
    assert "std_srvs" not in get_message_interfaces()
    assert sorted(get_service_interfaces()["std_srvs"]) == ["srv/Empty", "srv/SetBool", "srv/Trigger"]
    assert "action/Fibonacci" in get_action_interfaces()[PACKAGE]


@pytest.mark.parametrize("name", ["std_msgs/msg/String", "std_msgs/msg/String.msg"])
def test_interface_path_is_the_definition_file(name: str) -> None:
    path = get_interface_path(name)
    assert path.endswith("std_msgs/msg/String.msg")
    with open(path) as file:
        assert "string data" in file.read()


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("std_msgs", ValueError, "Expected at least two parts separated by '/'"),
        ("std_msgs//String", ValueError, "Must not contain empty parts"),
        ("std_msgs/../String", ValueError, "Must not contain '..'"),
        ("nothing/msg/String", LookupError, "Unknown package 'nothing'"),
        ("std_msgs/msg/Nothing", LookupError, "Could not find the interface"),
    ],
)
def test_interface_path_of_a_wrong_name_is_an_error(name: str, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        get_interface_path(name)
