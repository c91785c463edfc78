"""Interfaces by name, such as ``std_msgs/msg/String``."""

from __future__ import annotations

from typing import Any

from rosidl_parser.definition import NamespacedType
from rosidl_runtime_py.import_message import import_message_from_namespaced_type


def get_interface(identifier: str) -> Any:
    """Return the class of a message, service or action by its full name."""
    return import_message_from_namespaced_type(get_namespaced_type(identifier))


def get_message(identifier: str) -> Any:
    """Return the class of a message, by ``std_msgs/msg/String`` or ``std_msgs/String``.

    :raises ModuleNotFoundError: if its package is unknown.
    :raises AttributeError: if its package does not define it.
    :raises ValueError: if it is another kind of interface.
    """
    interface = import_message_from_namespaced_type(get_message_namespaced_type(identifier))
    if not is_message(interface):
        raise ValueError(f"Expected the full name of a message, got '{identifier}'")
    return interface


def get_service(identifier: str) -> Any:
    """Return the class of a service, with or without ``/srv/`` in its name; errors as get_message."""
    interface = import_message_from_namespaced_type(get_service_namespaced_type(identifier))
    if not is_service(interface):
        raise ValueError(f"Expected the full name of a service, got '{identifier}'")
    return interface


def get_action(identifier: str) -> Any:
    """Return the class of an action, with or without ``/action/`` in its name; errors as get_message."""
    interface = import_message_from_namespaced_type(get_action_namespaced_type(identifier))
    if not is_action(interface):
        raise ValueError(f"Expected the full name of an action, got '{identifier}'")
    return interface


def get_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of the full name of an interface."""
    *namespaces, name = identifier.split("/")
    return NamespacedType(namespaces, name)


def get_message_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of the name of a message; ``msg`` may be left out."""
    return _with_default(identifier, "msg")


def get_service_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of the name of a service; ``srv`` may be left out."""
    return _with_default(identifier, "srv")


def get_action_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of the name of an action; ``action`` may be left out."""
    return _with_default(identifier, "action")


def _with_default(identifier: str, kind: str) -> NamespacedType:
    type_ = get_namespaced_type(identifier)
    return NamespacedType([*type_.namespaces, kind], type_.name) if len(type_.namespaces) == 1 else type_


def is_message(interface: Any) -> bool:
    """Return whether it is the class of a message."""
    return hasattr(interface, "SLOT_TYPES")


def is_service(interface: Any) -> bool:
    """Return whether it is the class of a service."""
    return hasattr(interface, "Request") and hasattr(interface, "Response")


def is_action(interface: Any) -> bool:
    """Return whether it is the class of an action."""
    return all(hasattr(interface, part) for part in ("Goal", "Result", "Feedback"))
