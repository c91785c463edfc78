"""Validates node names (ROS 2 design, "Topic and Service name mapping to DDS")."""

from __future__ import annotations

import re
from typing import Literal

from rclpy.exceptions import InvalidNodeNameException

_MAX_LENGTH = 255


def validate_node_name(node_name: str) -> Literal[True]:
    """Check for letters, digits, underscores, and no digit first. Raises InvalidNodeNameException."""
    if problem := _problem(node_name):
        raise InvalidNodeNameException(node_name, *problem)
    return True


def _problem(name: str) -> tuple[str, int] | None:
    if not name:
        return "node name must not be empty", 0
    if stray := re.search(r"[^0-9A-Za-z_]", name):
        return "node name must not contain characters other than alphanumerics or '_'", stray.start()
    if name[0].isdigit():
        return "node name must not start with a number", 0
    if len(name) > _MAX_LENGTH:
        return f"node name length should not exceed '{_MAX_LENGTH}'", _MAX_LENGTH - 1
    return None
