"""Interfaces by name, such as ``std_msgs/msg/String``."""

from __future__ import annotations

import importlib
from typing import Any


def get_message(identifier: str) -> Any:
    """Return the class of a message, by ``std_msgs/msg/String`` or ``std_msgs/String``.

    :raises ModuleNotFoundError: if its package is unknown.
    :raises AttributeError: if its package does not define it.
    :raises ValueError: if it is another kind of interface.
    """
    return _interface(identifier, "msg", "a message", ("SLOT_TYPES",))


def get_service(identifier: str) -> Any:
    """Return the class of a service, with or without ``/srv/`` in its name; errors as get_message."""
    return _interface(identifier, "srv", "a service", ("Request", "Response"))


def get_action(identifier: str) -> Any:
    """Return the class of an action, with or without ``/action/`` in its name; errors as get_message."""
    return _interface(identifier, "action", "an action", ("Goal", "Result", "Feedback"))


def _interface(identifier: str, kind: str, which: str, parts: tuple[str, ...]) -> Any:
    *namespaces, name = identifier.split("/")
    if len(namespaces) == 1:
        namespaces.append(kind)
    module = importlib.import_module(".".join(namespaces))
    if name.endswith("_FeedbackMessage"):  # generated for each action, within its class
        return getattr(module, name.removesuffix("_FeedbackMessage")).Impl.FeedbackMessage
    found = getattr(module, name)
    if not all(hasattr(found, part) for part in parts):
        raise ValueError(f"Expected the full name of {which}, got '{identifier}'")
    return found
