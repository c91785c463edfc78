"""Texts and files of parameters that rclpy cannot read, or reads as impossible values."""

from __future__ import annotations

from pathlib import Path

import pytest

from rclpy.parameter import get_parameter_value, parameter_dict_from_yaml_file, parameter_value_to_python


@pytest.mark.parametrize("text", ["{a: 1}", "2020-01-01", "a: b: c"])
def test_a_text_that_is_no_parameter_in_yaml_is_a_string(text: str) -> None:
    assert parameter_value_to_python(get_parameter_value(text)) == text


def test_an_empty_file_is_not_a_valid_parameter_file(tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text("")
    with pytest.raises(RuntimeError, match="not a valid ROS parameter file"):
        parameter_dict_from_yaml_file(str(path))
