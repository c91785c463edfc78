"""Reads the lines of definition files."""

from __future__ import annotations

import re

_PRIMITIVES = {
    *("bool", "byte", "char", "float32", "float64", "string", "wstring"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}


def message_type(line: str, package: str) -> str | None:
    """The full name of the message that a line declares a field of; None for other lines."""
    match = re.match(r"\s*([A-Za-z][A-Za-z0-9_/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+\w", line)
    if not match or match[1] in _PRIMITIVES:
        return None
    scope, _, name = match[1].rpartition("/")
    return f"{scope.partition('/')[0] or package}/msg/{name}"
