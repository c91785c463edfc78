from __future__ import annotations

from typing import Any

import pytest

DUMP = """\
/arm/lab:
  ros__parameters:
    length: 2.0
    limits:
      speed: 3
    names:
    - a
    - b
    start_type_description_service: true
    use_sim_time: false

"""


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            [],
            "/arm/lab:\n  length\n  limits.speed\n  names\n"
            "  start_type_description_service\n  use_sim_time\n",
        ),
        (["/arm/lab", "--filter", "l"], "  length\n  limits.speed\n"),
        (["arm/lab", "--param-prefixes", "limits", "nothing"], "  limits.speed\n"),
        (
            ["/arm/lab", "--param-type", "--filter", "l|n"],
            "  length (type: double)\n  limits.speed (type: integer)\n  names (type: string array)\n",
        ),
    ],
)
def test_list_shows_the_names_of_parameters(lab: Any, ros2: Any, options: list[str], text: str) -> None:
    done = ros2("param", "list", *options, "--no-daemon")
    assert (done.stdout, done.stderr, done.returncode) == (text, "", 0)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["length"], "Double value is: 2.0\n"),
        (["names"], "String values are: ['a', 'b']\n"),
        (["limits.speed"], "Integer value is: 3\n"),
        (["use_sim_time"], "Boolean value is: False\n"),
        (["limits.speed", "--hide-type"], "3\n"),
    ],
)
def test_get_shows_type_and_value(lab: Any, ros2: Any, arguments: list[str], text: str) -> None:
    done = ros2("param", "get", "/arm/lab", *arguments, "--no-daemon")
    assert (done.stdout, done.returncode) == (text, 0)


def test_set_changes_the_value_even_to_a_negative_one(lab: Any, ros2: Any) -> None:
    done = ros2("param", "set", "/arm/lab", "limits.speed", "-4", "--no-daemon")
    assert (done.stdout, done.returncode) == ("Set parameter successful\n", 0)
    assert lab.get_parameter("limits.speed").value == -4
    ros2("param", "set", "/arm/lab", "limits.speed", "3", "--no-daemon")
    assert lab.get_parameter("limits.speed").value == 3


def test_refused_value_is_explained(lab: Any, ros2: Any) -> None:
    done = ros2("param", "set", "/arm/lab", "length", "11.5", "--no-daemon")
    assert done.stderr.startswith("Setting parameter failed: Parameter ")
    assert done.stdout == ""
    assert lab.get_parameter("length").value == 2.0


def test_dump_is_a_parameter_file(lab: Any, ros2: Any) -> None:
    assert ros2("param", "dump", "/arm/lab", "--no-daemon").stdout == DUMP


def test_describe_shows_type_and_constraints(lab: Any, ros2: Any) -> None:
    assert ros2("param", "describe", "/arm/lab", "length", "names", "--no-daemon").stdout == (
        "Parameter name: length\n  Type: double\n  Description: length of a link [m]\n  Constraints:\n"
        "    Min value: 0.0\n    Max value: 10.0\n"
        "Parameter name: names\n  Type: string array\n  Constraints:\n"
    )
