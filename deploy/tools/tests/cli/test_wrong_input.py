"""Wrong values, names and numbers: each error is one line that names the input, and comes without a wait."""

from __future__ import annotations

import shlex
from typing import Any

import pytest

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:  # ROS 2's wheels
    from test_msgs.action import Fibonacci

BIG = "9" * 30
FIBONACCI = f"{Fibonacci.__module__.partition('.')[0]}/action/Fibonacci"
NO_VALUE = "cannot be the value of a parameter: "


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ("topic info /nothing --no-daemon", "Unknown topic '/nothing'"),
        ("topic echo /nothing --no-daemon", "Could not determine the type for the passed topic"),
        ("topic echo /arm/chatter std_msgs/msg/Nothing --no-daemon", "The passed message type is invalid"),
        (
            "topic echo /arm/chatter --field nothing --no-daemon",
            "Invalid field 'nothing': 'String' object has no attribute 'nothing'",
        ),
        ("topic echo /arm/chatter --field . --no-daemon", "Invalid field value '.'"),
        ("topic pub /x std_msgs/msg/Nothing", "The passed message type is invalid"),
        ("topic pub /x std_msgs/msg/String 5", "The passed value needs to be a dictionary in YAML format"),
        (
            "topic pub /x std_msgs/msg/String 'nothing: 5'",
            "Failed to populate field: 'String' object has no attribute 'nothing'",
        ),
        (
            "topic pub /x std_msgs/msg/String --max-wait-time-secs 0.3 -w 1",
            "Timed out waiting for subscribers: Expected 1 subcribers but only got 0 subscribers",
        ),
        ("service call /arm/switch std_srvs/srv/Nothing", "The passed service type is invalid"),
        (
            "service call /arm/switch std_srvs/srv/SetBool '{nothing: 1}'",
            "Failed to populate field: 'SetBool_Request' object has no attribute 'nothing'",
        ),
        ("action send_goal /f std_srvs/srv/SetBool", "The passed action type is invalid"),
        (
            f"action send_goal /f {FIBONACCI} '{{nothing: 1}}'",
            "Failed to populate message fields: "
            "AttributeError(\"'Fibonacci_Goal' object has no attribute 'nothing'\")",
        ),
        ("interface show nothing/msg/X", "Unknown package 'nothing'"),
        (
            "interface show std_msgs/String",
            "Invalid name 'std_msgs/String'. Expected three parts separated by '/'",
        ),
        ("node info /nothing --no-daemon", "Unable to find node '/nothing'"),
        ("param get /nothing length --no-daemon", "Node not found"),
        ("param list /nothing --no-daemon", "Node not found"),
        ("param set /nothing length 1 --no-daemon", "Node not found"),
        ("param dump /nothing --no-daemon", "Node not found"),
        ("param get /arm/lab nothing --no-daemon", "Parameter not set"),
    ],
)
def test_what_is_unknown_is_one_line_as_in_ros_2(lab: Any, ros2: Any, arguments: str, error: str) -> None:
    done = ros2(*shlex.split(arguments))
    assert (done.stderr, done.returncode) == (f"{error}\n", 1)


@pytest.mark.own  # ROS 2's own command line prints tracebacks
@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ("topic echo '/bad name'", "topic name '/bad name' is invalid: "),
        ("topic echo /arm/chatter --filter 'm.data ='", "The filter 'm.data =' is no Python expression: "),
        ("topic echo /arm/chatter --filter m.nothing", "The filter 'm.nothing' failed: "),
        ("topic pub /arm/x std_msgs/msg/String 'data: ['", "The value is no valid YAML: "),
        ("param set /arm/lab limits.speed '[1, a]'", f"'[1, a]' {NO_VALUE}"),
        ("param set /arm/lab limits.speed '{a: 1}'", NO_VALUE),
        ("param set /arm/lab limits.speed '[[1]]'", NO_VALUE),
        ("param set /arm/lab limits.speed '[&a 1, *a]'", NO_VALUE),
        (
            "topic pub -1 /x std_msgs/msg/String 'data: &a [*a]'",
            "no valid YAML: line 1, column 11: the alias",
        ),
        (f"topic pub -1 /x std_msgs/msg/Int64 '{{data: {BIG}}}'", "Failed to populate field: "),
        ("topic pub -1 /x std_msgs/msg/UInt8MultiArray '{data: [300]}'", "Failed to populate field"),
        ("topic pub -1 '/x y' std_msgs/msg/String", "Invalid topic name: topic name must not contain"),
        ("service call '/a b' std_srvs/srv/SetBool", "Invalid service name"),
        ("service call /arm/switch std_srvs/srv/SetBool '{data: [}'", "no valid YAML"),
        (f"action send_goal /f {FIBONACCI} '{{order: {BIG}}}'", "Failed to populate message fields: "),
        (f"action send_goal '/f b' {FIBONACCI}", "must not contain characters"),
        (f"action send_goal '' {FIBONACCI}", "must not be empty"),
    ],
)
def test_a_wrong_value_or_name_is_one_line(lab: Any, ros2: Any, arguments: str, reason: str) -> None:
    done = ros2(*shlex.split(arguments))
    assert done.returncode == 1
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


@pytest.mark.own
@pytest.mark.parametrize(
    "arguments",
    [
        "topic pub -t 2 -w 0 /x std_msgs/msg/String --rate nan",
        "topic pub -t 2 -w 0 /x std_msgs/msg/String --rate 1e-300",
        "topic pub -1 -w 0 /x std_msgs/msg/String --keep-alive 1e300",
        "topic pub -1 -w 0 /x std_msgs/msg/String --qos-liveliness-lease-duration-seconds inf",
        "topic echo /x --timeout nan",
        "topic list --spin-time inf",
    ],
)
def test_an_option_that_is_no_usable_number_is_an_error_of_usage(ros2: Any, arguments: str) -> None:
    done = ros2(*shlex.split(arguments))
    assert done.returncode == 2
    option, value = arguments.split()[-2:]
    last = done.stderr.splitlines()[-1].replace("'nan'", "nan")
    assert last.startswith("Error: Invalid value for ")
    assert f"'{option}': {float(value)} is not" in last
