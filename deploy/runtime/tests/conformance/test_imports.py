"""What can be imported from rclpy's modules, including what they import themselves: ported code does it."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest

# module -> the names that rclpy 7.1.3 has in it, without other modules and private names
NAMES = json.loads((Path(__file__).parents[1] / "facts" / "rclpy_names.json").read_text())


@pytest.mark.parametrize("module", NAMES)
def test_a_module_has_every_name_that_can_be_imported_from_it_in_ros_2(module: str) -> None:
    here = importlib.import_module(module)
    assert [name for name in NAMES[module].split() if not hasattr(here, name)] == []


def test_an_imported_name_is_what_it_is_at_home() -> None:
    from rcl_interfaces.msg import Parameter, ParameterDescriptor
    from rclpy import callback_groups, node

    assert node.ParameterDescriptor is ParameterDescriptor
    assert node.ParameterMsg is Parameter
    assert node.ReentrantCallbackGroup is callback_groups.ReentrantCallbackGroup


def test_an_interface_can_be_imported_from_the_module_that_it_has_in_ros_2() -> None:
    from geometry_msgs.msg._pose import Pose as FromModule
    from std_srvs.srv._set_bool import SetBool as FromServiceModule

    from geometry_msgs.msg import Pose, _pose
    from sensor_msgs_py import numpy_compat
    from std_srvs.srv import SetBool

    assert Pose is _pose.Pose is FromModule
    assert SetBool is FromServiceModule
    assert callable(numpy_compat.structured_to_unstructured)
    with pytest.raises(ImportError):
        importlib.import_module("geometry_msgs.msg._nothing")


def test_a_name_that_is_nowhere_cannot_be_imported() -> None:
    with pytest.raises(ImportError, match="cannot import name 'Nod'"):
        exec("from rclpy.node import Nod")
