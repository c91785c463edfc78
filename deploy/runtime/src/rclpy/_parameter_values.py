"""Parses parameter values of the command line: the value in `-p name:=value`."""

from __future__ import annotations

import re
from typing import Any

from rclpy._parameter_scalars import plain_scalar

# A text with any of these may be more than a plain scalar: a YAML parser decides.
_NOT_PLAIN = re.compile(r"""[\[\]{}'"!&*|>#%@`:,?\\\s]|^-$|^---|^\.\.\.""")


def parse_value(text: str) -> Any:
    """Convert the value of `-p name:=value`. Raises ValueError if no parameter can have it."""
    # The usual case, a plain scalar, needs no YAML parser, which takes time to import.
    if not _NOT_PLAIN.search(text):
        return plain_scalar(text)
    from rclpy._parameter_files import parse_yaml_value

    return parse_yaml_value(text)
