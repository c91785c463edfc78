from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

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


ODD = {
    "joint": "y",
    "other": "1e5",
    "many": ["n", "inf", "~"],
    "tiny": 5e-324,
    "a": 1,
    "a.b": "both",
    "a.b.c": 2.0,
    "dots..": "end",
    ".dot": True,
}
"""Parameters whose names and values PyYAML and rcl would read differently, or not at all."""
FREE = {"typed": Parameter.Type.STRING, "many_typed": Parameter.Type.DOUBLE_ARRAY}
"""Parameters that are declared by type alone."""


@pytest.fixture
def odd(lab: Any) -> Iterator[None]:
    for name, value in {**ODD, **FREE}.items():
        lab.declare_parameter(name, value)
    yield
    for name in {**ODD, **FREE}:
        lab.undeclare_parameter(name)


@pytest.mark.own  # that of ROS 2 dumps nothing here
def test_a_dump_is_loaded_as_the_same(odd: None, lab: Any, ros2: Any, tmp_path: Path) -> None:
    file = tmp_path / "dump.yaml"
    file.write_text(ros2("param", "dump", "/arm/lab", "--no-daemon").stdout)
    assert file.read_text().startswith("# many_typed: no parameter file can hold its value\n# typed: ")
    context = Context()
    context.init(["--ros-args", "--params-file", str(file)])
    options = {"automatically_declare_parameters_from_overrides": True, "start_parameter_services": False}
    loaded = Node("lab", namespace="/arm", context=context, **options)
    found = {name: each.value for name, each in loaded.get_parameters_by_prefix("").items()}
    loaded.destroy_node()
    context.shutdown()
    kept = {"length": 2.0, "names": ["a", "b"], "limits.speed": 3, "use_sim_time": False}
    assert found == {**ODD, **kept, "start_type_description_service": True}


@pytest.mark.own  # that of ROS 2 reads PyYAML's dialect
@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("joint", "n", "n"),
        ("joint", "1e5", "1e5"),
        ("joint", "010", "010"),
        ("joint", "a: b", "a: b"),
        ("joint", "'quoted'", "quoted"),
        ("joint", "", ""),
        ("typed", "inf", "inf"),
        ("tiny", "1e5", 1e5),
        ("a", "0x10", 16),
        (".dot", "n", False),
        ("many", "[a, 'y']", ["a", "y"]),
    ],
)
def test_set_reads_a_value_as_a_parameter_file_does(
    odd: None, lab: Any, ros2: Any, name: str, text: str, value: object
) -> None:
    done = ros2("param", "set", "/arm/lab", name, text, "--no-daemon")
    assert (done.stdout, done.stderr) == ("Set parameter successful\n", "")
    assert lab.get_parameter(name).value == value


def test_describe_shows_type_and_constraints(lab: Any, ros2: Any) -> None:
    assert ros2("param", "describe", "/arm/lab", "length", "names", "--no-daemon").stdout == (
        "Parameter name: length\n  Type: double\n  Description: length of a link [m]\n  Constraints:\n"
        "    Min value: 0.0\n    Max value: 10.0\n"
        "Parameter name: names\n  Type: string array\n  Constraints:\n"
    )
