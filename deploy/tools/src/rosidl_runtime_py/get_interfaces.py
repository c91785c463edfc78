"""Finds the interfaces of packages by their files: ``msg/*.msg``, ``srv/*.srv``, ``action/*.action``.

The folder of a package lies below ``share`` of a prefix in AMENT_PREFIX_PATH, or of the prefix into which
rclpy is installed (ROS 2's wheels). The first definition that is found in this order counts.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator
from pathlib import Path

KINDS = ("msg", "srv", "action")
"""The folders of definition files, which are also the suffixes of the files."""


def get_message_interfaces() -> dict[str, list[str]]:
    """Return the messages (``msg/String``) of all packages that define some."""
    return _interfaces("msg")


def get_service_interfaces() -> dict[str, list[str]]:
    """Return the services of all packages that define some."""
    return _interfaces("srv")


def get_action_interfaces() -> dict[str, list[str]]:
    """Return the actions of all packages that define some."""
    return _interfaces("action")


def _interfaces(kind: str) -> dict[str, list[str]]:
    found: dict[str, set[str]] = {}
    for folder in _folders():
        for path in folder.glob(f"*/{kind}/*.{kind}"):
            found.setdefault(path.parts[-3], set()).add(f"{kind}/{path.stem}")
    return {package: sorted(names) for package, names in sorted(found.items())}


def _folders() -> Iterator[Path]:
    """Yield the folders with the folders of packages."""
    prefixes = [Path(path) for path in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if path]
    rclpy = importlib.util.find_spec("rclpy")
    if rclpy and rclpy.origin:
        prefixes.append(Path(rclpy.origin).parents[4])  # of PREFIX/lib/python3.X/site-packages/rclpy
    for prefix in prefixes:
        if (prefix / "share").is_dir():
            yield prefix / "share"


def get_interface_path(interface_name: str) -> str:
    """Return an interface's file. Raises ValueError for a malformed name, LookupError for an unknown one."""
    parts = interface_name.split("/")
    if len(parts) < 2:
        raise ValueError(f"Invalid name '{interface_name}'. Expected at least two parts separated by '/'")
    if not all(parts):
        raise ValueError(f"Invalid name '{interface_name}'. Must not contain empty parts")
    if ".." in parts:
        raise ValueError(f"Invalid name '{interface_name}'. Must not contain '..'")
    name, suffix = os.path.splitext(interface_name)
    if len(parts) == 3 and suffix in ("", f".{parts[1]}") and parts[1] in KINDS:
        for folder in _folders():
            if (path := folder / f"{name}.{parts[1]}").is_file():
                return str(path)
    if not any(parts[0] in _interfaces(kind) for kind in KINDS):
        raise LookupError(f"Unknown package '{parts[0]}'")
    raise LookupError(f"Could not find the interface '{interface_name}'")
