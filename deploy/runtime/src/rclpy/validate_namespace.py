"""Validates namespaces."""

from __future__ import annotations

from typing import Literal

from rclpy import validate_full_topic_name
from rclpy.exceptions import InvalidNamespaceException

# Leaves two characters for a separator and the shortest node name.
_MAX_LENGTH = validate_full_topic_name._MAX_LENGTH - 2


def validate_namespace(namespace: str) -> Literal[True]:
    """Check an absolute namespace. Raises InvalidNamespaceException, whose message marks the place."""
    if problem := _problem(namespace):
        raise InvalidNamespaceException(namespace, *problem)
    return True


def _problem(namespace: str) -> tuple[str, int] | None:
    if namespace == "/":
        return None
    if namespace.endswith("/"):
        return "namespace must not end with a '/', unless only a '/'", len(namespace) - 1
    return validate_full_topic_name._problem(namespace, "namespace", _MAX_LENGTH)
