"""Lists the interfaces of packages: of those in this distribution, and of those in AMENT_PREFIX_PATH."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable

from rosidl_runtime_embedded.definition_files import (
    KINDS,
    definition_source,
    interface_names,
    interface_packages,
)


def get_interface_packages() -> dict[str, str]:
    """Return the names of all packages that define interfaces, with their prefixes."""
    return interface_packages()


def get_interfaces(package_names: Collection[str] = ()) -> dict[str, list[str]]:
    """
    Return the interfaces of packages, such as ``msg/String``, by their package.

    :param package_names: the packages; all packages if it is empty.
    :raises LookupError: if a package is unknown.
    """
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
    known = interface_packages()
    found = {}
    for package in package_names or known:
        if package not in known:
            raise LookupError(f"Unknown package '{package}'")
        names = [f"{kind}/{name}" for kind in kinds for name in interface_names(package, kind)]
        if names:
            found[package] = names
    return found


def get_interface_path(interface_name: str) -> str:
    """
    Return the file that defines an interface, such as ``std_msgs/msg/String``.

    :raises ValueError: if the name is malformed.
    :raises LookupError: if the package or the interface is unknown.
    """
    parts = interface_name.split("/")
    if len(parts) < 2:
        raise ValueError(f"Invalid name '{interface_name}'. Expected at least two parts separated by '/'")
    if not all(parts):
        raise ValueError(f"Invalid name '{interface_name}'. Must not contain empty parts")
    if ".." in parts:
        raise ValueError(f"Invalid name '{interface_name}'. Must not contain '..'")
    if parts[0] not in interface_packages():
        raise LookupError(f"Unknown package '{parts[0]}'")
    name, kind = os.path.splitext(interface_name)
    try:
        if len(parts) == 3 and kind in ("", f".{parts[1]}") and parts[1] in KINDS:
            return definition_source(name)[0]
    except LookupError:
        pass
    raise LookupError(f"Could not find the interface '{interface_name}'")
