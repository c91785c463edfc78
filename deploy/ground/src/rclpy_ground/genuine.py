"""The C extension of the installed rclpy, under another name.

It gives what neither communicates nor waits: QoS, names, arguments, enumerations, errors, durations, time
points and deserialization. No node is ever created with it, so no participant of DDS.
"""

from __future__ import annotations

import importlib.util
import sys
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from pathlib import Path
from typing import Any

NAME = "_rclpy_pybind11"
"""The module that rclpy imports."""


def _find() -> Path:
    spec = importlib.util.find_spec("rclpy")
    for place in (spec and spec.submodule_search_locations) or ():
        for suffix in EXTENSION_SUFFIXES:
            if (path := Path(place, NAME + suffix)).exists():
                return path
        raise ImportError(
            f"rclpy_ground needs ROS 2's own rclpy, Jazzy or Kilted: that in {place} has no {NAME}"
        )
    raise ImportError(
        "rclpy_ground needs ROS 2's own rclpy: source ROS 2, or"
        ' pip install "ros-jazzy-rclpy[fastrtps]" ros-jazzy-common-interfaces'
    )


def _load(path: Path) -> Any:
    if f"rclpy.{NAME}" in sys.modules:
        raise ImportError(
            "rclpy was imported before its ground was chosen:"
            " import rclpy_simulation or what else chooses it first"
        )
    # Behind the last dot of the name stands what the function that makes the module is called after.
    name = f"{__package__}.{NAME}"
    loader = ExtensionFileLoader(name, str(path))
    module = importlib.util.module_from_spec(ModuleSpec(name, loader, origin=str(path)))
    loader.exec_module(module)
    return module


PATH = _find()
genuine: Any = _load(PATH)
RCLError: Any = genuine.RCLError
RMWError: Any = genuine.RMWError
InvalidHandle: Any = genuine.InvalidHandle


def predefined(name: str) -> Any:
    """Return a QoS profile of rmw by its name, for example ``qos_profile_services_default``."""
    return genuine.rmw_qos_profile_t.predefined(name)
