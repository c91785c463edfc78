"""Validates parameter names."""

from __future__ import annotations

from typing import Literal

from rclpy.exceptions import InvalidParameterException


def validate_parameter_name(name: str) -> Literal[True]:
    """Check that the parameter `name` is not empty. Raises InvalidParameterException if it is."""
    if not name:
        raise InvalidParameterException(name)
    return True
