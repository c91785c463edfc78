"""The names of messages, services and actions, and prototypes of their values."""

from __future__ import annotations

from typing import Any

from rosidl_runtime_py import (
    get_action_interfaces,
    get_interface_packages,
    get_message_interfaces,
    get_service_interfaces,
    message_to_yaml,
)
from rosidl_runtime_py.utilities import get_interface, is_action, is_service


def package_name_completer(**kwargs: Any) -> Any:
    """Return the names of packages with interfaces."""
    return get_interface_packages()


def type_completer(**kwargs: Any) -> list[str]:
    """Return the full names of all interfaces, sorted."""
    kinds = (get_message_interfaces(), get_service_interfaces(), get_action_interfaces())
    return sorted(f"{package}/{name}" for kind in kinds for package, names in kind.items() for name in names)


def interface_to_yaml(identifier: str) -> str:
    """Return the default values of a message, a service's request or an action's goal."""
    interface = get_interface(identifier)
    if is_action(interface):
        interface = interface.Goal
    elif is_service(interface):
        interface = interface.Request
    return message_to_yaml(interface())
