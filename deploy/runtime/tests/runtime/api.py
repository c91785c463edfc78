"""Prints the public API of the rclpy that Python finds as JSON."""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import re
from enum import Enum
from typing import Any

import rclpy


def parameters(function: Any) -> list[tuple[str, str, bool]] | None:
    """Name, kind and whether there is a default of each parameter; ``None`` for a function in C."""
    try:
        found = inspect.signature(function).parameters.values()
    except ValueError:
        return None
    return [(each.name, each.kind.name, each.default is not each.empty) for each in found]


def members(cls: type) -> dict[str, Any]:
    """The public members of a class: parameters of methods, ``"property"`` for all others."""
    found: dict[str, Any] = {}
    for name, member in vars(cls).items():
        if name.startswith("_") and name not in ("__init__", "__enter__", "__exit__"):
            continue
        if isinstance(member, classmethod | staticmethod):
            member = member.__func__
        is_method = callable(member) and not isinstance(member, type)
        found[name] = parameters(member) if is_method else "property"
    return found


def entry(value: Any) -> dict[str, Any]:
    if not isinstance(value, type):
        return {"parameters": parameters(value)} if inspect.isroutine(value) else {}
    found = {"bases": [base.__name__ for base in value.__bases__], "methods": members(value)}
    if issubclass(value, Enum):
        return found | {"methods": {}, "members": {each.name: str(each.value) for each in value}}
    return found


def is_public(module: Any, name: str, value: Any) -> bool:
    """Whether a name of a module is a part of its API: what it defines, and what a package exports."""
    if name.startswith("_") or name == "TYPE_CHECKING":
        return False
    if isinstance(value, type) or inspect.isroutine(value):
        owner = str(value.__module__)
        if not owner.startswith("rclpy"):
            return False
        if owner == module.__name__ or hasattr(module, "__path__"):
            return True
    elif not isinstance(value, int | str) and type(value).__module__ != "rclpy.qos":
        return False
    return re.search(rf"(?m)^{name}\b[^=\n]*=", inspect.getsource(module)) is not None


def module_api(name: str) -> dict[str, Any]:
    module = importlib.import_module(name)
    return {key: entry(value) for key, value in vars(module).items() if is_public(module, key, value)}


if __name__ == "__main__":
    found = (module.name for module in pkgutil.walk_packages(rclpy.__path__, "rclpy."))
    public = [name for name in found if "._" not in name and not name.startswith("rclpy.impl")]
    print(json.dumps({name: module_api(name) for name in ("rclpy", *public)}))
