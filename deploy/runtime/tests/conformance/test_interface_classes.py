"""Classes of messages and services: their names, modules, metaclasses and constants."""

from __future__ import annotations

import importlib
import pickle
import subprocess
import sys
from typing import Any

import pytest

from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion
from sensor_msgs.msg import NavSatStatus, PointCloud2
from std_msgs.msg import ColorRGBA, String, UInt8MultiArray
from std_srvs.srv import Trigger

MODULES = {
    String: "std_msgs.msg._string",
    ColorRGBA: "std_msgs.msg._color_rgba",
    UInt8MultiArray: "std_msgs.msg._u_int8_multi_array",
    PointCloud2: "sensor_msgs.msg._point_cloud2",
    PoseWithCovarianceStamped: "geometry_msgs.msg._pose_with_covariance_stamped",
    Trigger: "std_srvs.srv._trigger",
    Trigger.Request: "std_srvs.srv._trigger",
    Trigger.Event: "std_srvs.srv._trigger",
}


@pytest.mark.parametrize(("cls", "module"), MODULES.items())
def test_a_class_names_the_module_that_defines_it(cls: Any, module: str) -> None:
    assert cls.__module__ == cls.__class__.__module__ == module
    assert cls.__class__.__name__ == f"Metaclass_{cls.__name__}"
    defined = importlib.import_module(module)
    assert getattr(defined, cls.__name__) is cls
    assert getattr(defined, f"Metaclass_{cls.__name__}") is cls.__class__


def test_the_text_of_a_class_tells_its_type() -> None:
    # rosbridge_library.internal.message_conversion reads the parts 0, 1 and 3
    assert str(String) == "<class 'std_msgs.msg._string.String'>"


def test_the_text_of_a_message_names_its_package_only() -> None:
    assert repr(String(data="a")) == "std_msgs.msg.String(data='a')"
    assert repr(Trigger.Request()) == "std_srvs.srv.Trigger_Request()"


def test_the_text_of_a_derived_message_drops_its_last_module() -> None:
    class Name(String):  # type: ignore[misc]
        __module__ = "robot.names"

    assert repr(Name(data="a")) == "robot.Name(data='a')"
    Name.__module__ = "__main__"
    assert repr(Name(data="a")) == "Name(data='a')"


def test_a_message_can_be_pickled() -> None:
    message = String(data="a")
    assert pickle.loads(pickle.dumps(message)) == message
    assert pickle.loads(pickle.dumps(Trigger.Request)) is Trigger.Request


@pytest.mark.parametrize(
    ("cls", "name", "value"),
    [
        (DiagnosticStatus, "ERROR", b"\2"),
        (GoalStatus, "STATUS_ABORTED", 6),
        (NavSatStatus, "STATUS_NO_FIX", -1),
        (Quaternion, "W__DEFAULT", 1.0),
    ],
)
def test_constants_and_defaults_of_a_class_cannot_be_changed(cls: Any, name: str, value: object) -> None:
    with pytest.raises(AttributeError, match=name):
        setattr(cls, name, None)
    with pytest.raises(AttributeError, match=name):
        delattr(cls, name)
    with pytest.raises(AttributeError, match=name):
        setattr(cls(), name, None)
    assert getattr(cls, name) == getattr(cls(), name) == value


@pytest.mark.parametrize("cls", [String, Trigger, Trigger.Response])
def test_an_interface_has_a_type_support_after_its_import(cls: Any) -> None:
    cls.__class__.__import_type_support__()
    assert cls.__class__._TYPE_SUPPORT is not None


def test_a_module_of_an_interface_has_no_other_classes() -> None:
    with pytest.raises(ImportError, match="Bool"):
        exec("from std_msgs.msg._string import Bool")
    with pytest.raises(ImportError, match="Metaclass_Bool"):
        exec("from std_msgs.msg._string import Metaclass_Bool")


def test_a_package_in_use_has_its_modules_without_their_import() -> None:
    # diagnostic_updater's example imports `diagnostic_msgs` and `std_msgs` only
    code = (
        "import std_msgs, std_srvs, rclpy\n"
        "from rclpy.type_support import check_for_type_support\n"
        "from diagnostic_msgs.msg import DiagnosticArray\n"
        "check_for_type_support(DiagnosticArray)\n"
        "assert std_msgs.msg.Header() == DiagnosticArray().header\n"
        "assert not hasattr(std_msgs, 'srv') and not hasattr(std_msgs, 'nothing')"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
