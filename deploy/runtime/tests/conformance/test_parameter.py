from __future__ import annotations

import array
from pathlib import Path
from typing import Any

import pytest

from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterType, ParameterValue
from rclpy.parameter import (
    Parameter,
    get_parameter_value,
    parameter_dict_from_yaml_file,
    parameter_value_to_python,
)

VALUES = [
    (Parameter.Type.NOT_SET, None),
    (Parameter.Type.BOOL, True),
    (Parameter.Type.INTEGER, 42),
    (Parameter.Type.DOUBLE, 2.41),
    (Parameter.Type.STRING, "hello"),
    (Parameter.Type.BYTE_ARRAY, [b"p", b"v"]),
    (Parameter.Type.BOOL_ARRAY, [True, False]),
    (Parameter.Type.INTEGER_ARRAY, [1, 2, 3]),
    (Parameter.Type.DOUBLE_ARRAY, [1.5, 2.5]),
    (Parameter.Type.STRING_ARRAY, ["a", "b"]),
]


@pytest.mark.parametrize(("type_", "value"), VALUES)
def test_a_parameter_survives_conversion_to_a_message(type_: Parameter.Type, value: Any) -> None:
    parameter = Parameter("name", value=value)
    assert (parameter.name, parameter.type_, parameter.value) == ("name", type_, value)
    message = parameter.to_parameter_msg()
    assert message.value.type == type_.value
    again = Parameter.from_parameter_msg(message)
    assert again.type_ is type_
    assert (list(again.value) if isinstance(value, list) else again.value) == value
    assert parameter_value_to_python(message.value) == value


@pytest.mark.parametrize(("type_", "value"), VALUES)
def test_a_value_fits_only_its_type(type_: Parameter.Type, value: Any) -> None:
    for other in Parameter.Type:
        is_an_int_too = type_ in (Parameter.Type.BOOL, Parameter.Type.BOOL_ARRAY)
        if is_an_int_too and other in (Parameter.Type.INTEGER, Parameter.Type.INTEGER_ARRAY):
            continue
        assert other.check(value) is (other is type_), other


def test_tuples_and_numeric_arrays_are_values_too() -> None:
    assert Parameter("x", value=(1, 2)).type_ is Parameter.Type.INTEGER_ARRAY
    assert Parameter("x", value=array.array("d", [1.0])).type_ is Parameter.Type.DOUBLE_ARRAY
    assert Parameter("x", Parameter.Type.INTEGER_ARRAY, array.array("q", [1])).value[0] == 1
    assert not Parameter.Type.STRING_ARRAY.check(array.array("q", [1]))


def test_an_empty_list_fits_any_array_type_and_defaults_to_bytes() -> None:
    assert Parameter("x", value=[]).type_ is Parameter.Type.BYTE_ARRAY
    assert Parameter("x", Parameter.Type.STRING_ARRAY, []).value == []


@pytest.mark.parametrize("value", [{}, object(), [1, "a"], [1, 2.0], [None], {1, 2}])
def test_values_of_other_types_are_an_error(value: Any) -> None:
    with pytest.raises(TypeError, match="allowed types"):
        Parameter("x", value=value)


def test_a_value_that_does_not_fit_the_given_type_is_an_error() -> None:
    with pytest.raises(ValueError, match="do not agree"):
        Parameter("x", Parameter.Type.STRING, 1)
    with pytest.raises(ValueError, match="do not agree"):
        Parameter("x", Parameter.Type.BYTE_ARRAY, [b"ab"])
    with pytest.raises(TypeError, match="type must be"):
        Parameter("x", "STRING", "a")  # type: ignore[arg-type]


def test_types_have_the_names_and_numbers_of_rclpy() -> None:
    assert str(Parameter.Type.BOOL) == "Type.BOOL"
    assert [type_.value for type_ in Parameter.Type] == list(range(10))
    assert Parameter.Type.BOOL.value == ParameterType.PARAMETER_BOOL


def test_a_message_with_an_unknown_type_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="unexpected parameter type 17"):
        parameter_value_to_python(ParameterValue(type=17))
    with pytest.raises(ValueError, match="17 is not a valid"):
        Parameter.from_parameter_msg(ParameterMsg(name="x", value=ParameterValue(type=17)))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("true", True),
        ("42", 42),
        ("4.5", 4.5),
        ("hello", "hello"),
        ("", ""),
        ("null", "null"),
        ("'42'", "42"),
        ("[true, false]", [True, False]),
        ("[1, 2]", [1, 2]),
        ("[1.5]", [1.5]),
        ("[a, b]", ["a", "b"]),
        ("[]", []),
        ("[1, 2.5]", "[1, 2.5]"),
        ("[1", "[1"),
    ],
)
def test_a_text_is_parsed_as_yaml_or_kept_as_a_string(text: str, value: Any) -> None:
    assert parameter_value_to_python(get_parameter_value(text)) == value


def test_an_empty_list_as_text_is_a_bool_array() -> None:
    assert get_parameter_value("[]").type == ParameterType.PARAMETER_BOOL_ARRAY


FILE = """
/**:
  ros__parameters: {shared: 1, own: 1}
/first:
  ros__parameters: {own: 2, nested: {deep: {x: 1.5}}, text: "12"}
/second:
  ros__parameters: {second: [a]}
/broken: 5
"""


def read(path: Path, **arguments: Any) -> dict[str, Any]:
    messages = parameter_dict_from_yaml_file(str(path), **arguments)
    assert all(message.name == name for name, message in messages.items())
    return {name: parameter_value_to_python(message.value) for name, message in messages.items()}


def test_a_file_is_read_for_the_target_nodes(tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(FILE)
    own = {"own": 2, "nested.deep.x": 1.5, "text": 12}  # quotes are ignored, as in rclpy
    assert read(path, target_nodes=["/first"]) == own
    assert read(path, target_nodes=["/first"], use_wildcard=True) == {"shared": 1, **own}
    assert read(path, target_nodes=["/second"], namespace="ns.") == {"ns.second": ["a"]}
    with pytest.raises(RuntimeError, match="does not contain parameters for /third"):
        read(path, target_nodes=["/third"])
    with pytest.raises(RuntimeError, match="for node /broken"):
        read(path)


def test_without_targets_all_nodes_but_the_wildcard_are_read(tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(FILE.replace("/broken: 5", ""))
    assert set(read(path)) == {"own", "nested.deep.x", "text", "second"}
    path.write_text("/**: {ros__parameters: {x: 1}}")
    assert read(path, use_wildcard=True) == {"x": 1}
    with pytest.raises(RuntimeError, match="selected parameters"):
        read(path)
