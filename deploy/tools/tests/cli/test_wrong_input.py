"""Wrong values, names and numbers: each error is one line that names the input, and comes without a wait.

ROS 2's own command line prints tracebacks.
"""

from __future__ import annotations

import importlib.util
import shlex
from typing import Any

import pytest

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:  # ROS 2's wheels
    from test_msgs.action import Fibonacci

pytestmark = pytest.mark.own
BIG = "9" * 30
FIBONACCI = f"{Fibonacci.__module__.partition('.')[0]}/action/Fibonacci"
NO_VALUE = "cannot be the value of a parameter: "
# ROS 2's rclpy accepts these values, and warns on standard error of what follows from a wrong name.
ONLY_EMBEDDED = [
    ("topic pub -1 /x std_msgs/msg/Int8 '{data: 300}'", "field 'data' must be int8, not 300"),
    ("topic pub -1 /x std_msgs/msg/String '{data: \"\\0\"}'", "contains a NUL"),
    ("topic pub -1 -n 'a b' /x std_msgs/msg/String", "Invalid node name"),
]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (f"param set /arm/lab limits.speed {BIG}", f"'{BIG}' {NO_VALUE}"),
        (f"param set /arm/lab limits.speed -{BIG}", f"'-{BIG}' {NO_VALUE}"),
        (f"param set /arm/lab limits.speed '[{BIG}]'", NO_VALUE),
        ("param set /arm/lab limits.speed '!!int x'", f"'!!int x' {NO_VALUE}"),
        ("param set /arm/lab limits.speed '!!timestamp x'", NO_VALUE),
        (f"topic pub -1 /x std_msgs/msg/Int64 '{{data: {BIG}}}'", "Failed to populate field: "),
        ("topic pub -1 /x std_msgs/msg/UInt8MultiArray '{data: [300]}'", "Failed to populate field"),
        ("topic pub -1 '/x y' std_msgs/msg/String", "Invalid topic name: topic name must not contain"),
        ("service call '/a b' std_srvs/srv/SetBool", "Invalid service name"),
        ("service call /arm/switch std_srvs/srv/SetBool '{data: [}'", "no valid YAML"),
        (f"action send_goal /f {FIBONACCI} '{{order: {BIG}}}'", "Failed to populate message fields: "),
        (f"action send_goal '/f b' {FIBONACCI}", "must not contain characters"),
        (f"action send_goal '' {FIBONACCI}", "must not be empty"),
        *(ONLY_EMBEDDED if importlib.util.find_spec("rosidl_runtime_embedded") else []),
    ],
)
def test_a_wrong_value_or_name_is_one_line(lab: Any, ros2: Any, arguments: str, reason: str) -> None:
    done = ros2(*shlex.split(arguments))
    assert done.returncode == 1
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


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
