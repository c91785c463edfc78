"""Finds the interfaces of packages by their files: ``msg/*.msg``, ``srv/*.srv``, ``action/*.action``.

The folder of a package lies next to rclpy (rclpy-cyclonedds), below ``share`` of a prefix in
AMENT_PREFIX_PATH, or below ``share`` of the prefix into which rclpy is installed (ROS 2's wheels). The first
definition that is found in this order counts.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

KINDS = ("msg", "srv", "action")
"""The folders of definition files, which are also the suffixes of the files."""


def get_interface_packages() -> dict[str, str]:
    """Return the names of all packages that define interfaces, with their prefixes."""
    found: dict[str, str] = {}
    for prefix, folder in _folders():
        for package in os.listdir(folder):
            if any(_names(folder / package, kind) for kind in KINDS):
                found.setdefault(package, str(prefix))
    return dict(sorted(found.items()))


def get_interfaces(package_names: Collection[str] = ()) -> dict[str, list[str]]:
    """Return the interfaces (``msg/String``) of these packages, or of all. Raises LookupError."""
    return _interfaces(package_names, KINDS)


def get_message_interfaces(package_names: Collection[str] = ()) -> dict[str, list[str]]:
    """Return the messages of packages, as `get_interfaces` does."""
    return _interfaces(package_names, ["msg"])


def get_service_interfaces(package_names: Collection[str] = ()) -> dict[str, list[str]]:
    """Return the services of packages, as `get_interfaces` does."""
    return _interfaces(package_names, ["srv"])


def get_action_interfaces(package_names: Collection[str] = ()) -> dict[str, list[str]]:
    """Return the actions of packages, as `get_interfaces` does."""
    return _interfaces(package_names, ["action"])


def _interfaces(package_names: Collection[str], kinds: Iterable[str]) -> dict[str, list[str]]:
    known = get_interface_packages()
    folders = [folder for _, folder in _folders()]
    found = {}
    for package in package_names or known:
        if package not in known:
            raise LookupError(f"Unknown package '{package}'")
        names = [
            f"{kind}/{name}"
            for kind in kinds
            for name in sorted(set().union(*(_names(folder / package, kind) for folder in folders)))
        ]
        if names:
            found[package] = names
    return found


def _folders() -> Iterator[tuple[Path, Path]]:
    """Yield the folders of packages that exist, each after its prefix."""
    prefixes = [Path(path) for path in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if path]
    rclpy = importlib.util.find_spec("rclpy")
    if rclpy and rclpy.origin:
        beside = Path(rclpy.origin).parents[1]
        yield beside, beside
        prefixes.append(beside.parents[2])  # of PREFIX/lib/python3.X/site-packages
    for prefix in prefixes:
        if (prefix / "share").is_dir():
            yield prefix, prefix / "share"


def _names(package: Path, kind: str) -> set[str]:
    """The names of the messages, services or actions whose definitions are in the folder of a package."""
    return {path.stem for path in package.joinpath(kind).glob(f"*.{kind}")}


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
        for _, folder in _folders():
            if (path := folder / f"{name}.{parts[1]}").is_file():
                return str(path)
    if parts[0] not in get_interface_packages():
        raise LookupError(f"Unknown package '{parts[0]}'")
    raise LookupError(f"Could not find the interface '{interface_name}'")
