"""Validates fully qualified names of topics and services."""

from __future__ import annotations

import re
from typing import Literal

from rclpy.exceptions import InvalidServiceNameException, InvalidTopicNameException

# DDS allows 255 characters. ROS 2 reserves 8 for prefixes and suffixes.
_MAX_LENGTH = 255 - 8


def validate_full_topic_name(name: str, *, is_service: bool = False) -> Literal[True]:
    """Check a full name. Raises InvalidTopicNameException, for a service InvalidServiceNameException."""
    if problem := _problem(name, "topic name", _MAX_LENGTH):
        error = InvalidServiceNameException if is_service else InvalidTopicNameException
        raise error(name, *problem)
    return True


def _problem(name: str, what: str, max_length: int) -> tuple[str, int] | None:
    if not name:
        return f"{what} must not be empty", 0
    if name[0] != "/":
        return f"{what} must be absolute, it must lead with a '/'", 0
    if name[-1] == "/":
        return f"{what} must not end with a '/'", len(name) - 1
    if stray := re.search(r"[^0-9A-Za-z_/]", name):
        return f"{what} must not contain characters other than alphanumerics, '_', or '/'", stray.start()
    if bad := re.search(r"/(?:(/)|[0-9])", name):
        if bad[1]:
            return f"{what} must not contain repeated '/'", bad.end() - 1
        return f"{what} must not have a token that starts with a number", bad.end() - 1
    if len(name) > max_length:
        return f"{what} length should not exceed '{max_length}'", max_length - 1
    return None
