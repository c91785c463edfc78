"""Parameter values on the command line: the value of `-p name:=value`."""

from __future__ import annotations

import re
from typing import Any

from rclpy._parameter_scalars import plain_scalar

# What makes a text more than a plain scalar, or may: only a YAML parser knows.
_NOT_PLAIN = re.compile(r"""[\[\]{}'"!&*|>#%@`:,?\\\s]|^-$|^---|^\.\.\.""")


def parse_value(text: str) -> Any:
    """
    Convert the value of `-p name:=value`.

    :raises ValueError: if it is empty, no valid YAML, or neither a scalar nor a list of scalars of one type.
    """
    # Plain scalars, the usual case, need no YAML parser, which takes time to import.
    if not _NOT_PLAIN.search(text):
        return plain_scalar(text)
    from rclpy._parameter_files import parse_yaml_value

    return parse_yaml_value(text)
