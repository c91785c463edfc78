"""Private names of public classes: those of ROS 2, or with a prefix, so that subclasses may use the rest."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import pkgutil
import textwrap
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import ModuleType

import message_filters
import pytest
import tf2_py
import tf2_ros

import rclpy

RCLPY = json.loads((Path(__file__).parents[1] / "facts" / "private_names.json").read_text())
"""Private names of each class of rclpy 7.1.6 and of its bases, read from its source."""
TF2 = {"BufferCore": ["_chain", "_frameExists", "_getFrameStrings"]}
PACKAGES: list[tuple[ModuleType, str, dict[str, list[str]]]] = [
    (rclpy, "_rclpy_", RCLPY),
    (tf2_py, "_tf2_", TF2),
    (tf2_ros, "_tf2_", {**TF2, "Buffer": TF2["BufferCore"]}),
    (message_filters, "_message_filters_", {}),
]


@pytest.mark.filterwarnings("ignore:rclpy.qos_event is deprecated")
def test_every_private_name_of_a_public_class_is_of_ros_2_or_has_a_prefix() -> None:
    surplus = {
        f"{package.__name__}: {cls.__name__}.{name}"
        for package, prefix, known in PACKAGES
        for cls in _public_classes(package)
        for name in _private_names(cls) - {*known.get(cls.__name__, ())}
        if not name.startswith(prefix)
    }
    assert sorted(surplus) == []


def _public_classes(package: ModuleType) -> Iterator[type]:
    names = [module.name for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]
    public = [name for name in names if not any(part.startswith("_") for part in name.split("."))]
    for name in (package.__name__, *public):
        for cls in vars(importlib.import_module(name)).values():
            if not isinstance(cls, type) or cls.__name__.startswith("_") or issubclass(cls, Enum | tuple):
                continue
            if cls.__module__ == name or (name == package.__name__ and cls.__module__.startswith(f"{name}.")):
                yield cls


def _private_names(cls: type) -> set[str]:
    """Names of members, and of attributes that methods set on themselves, of a class and its bases here."""
    names: set[str] = set()
    for base in cls.__mro__:
        if base.__module__.startswith(("rclpy", "tf2_", "message_filters")):
            names |= vars(base).keys() | _attributes_of_instances(base)
    ours = {name for name in names if name.startswith("_") and "__" not in name}  # Python mangles the others
    return ours - {"_abc_impl", "_is_protocol", "_is_runtime_protocol"}


def _attributes_of_instances(cls: type) -> set[str]:
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(definition, ast.ClassDef)
    methods = [
        method for method in definition.body if isinstance(method, ast.FunctionDef) and method.args.args
    ]
    return {
        node.attr
        for method in methods
        for node in ast.walk(method)
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
        if isinstance(node.value, ast.Name) and node.value.id == method.args.args[0].arg
    }
