"""Imports the class of an interface."""

from __future__ import annotations

import importlib
from typing import Any

from rosidl_parser.definition import NamespacedType


def import_message_from_namespaced_type(message_type: NamespacedType) -> Any:
    """Import the class of an interface. Raises ModuleNotFoundError, or AttributeError within its package."""
    module = importlib.import_module(".".join(message_type.namespaces))
    if message_type.name.endswith("_FeedbackMessage"):  # generated for each action, within its class
        action = getattr(module, message_type.name.removesuffix("_FeedbackMessage"))
        return action.Impl.FeedbackMessage
    return getattr(module, message_type.name)
