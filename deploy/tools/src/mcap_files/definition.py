"""Definitions of messages, as MCAP files embed them."""

from __future__ import annotations

import re
from pathlib import Path

from rosidl_runtime_py import get_interface_path

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


def definition(type_name: str) -> tuple[str, bytes]:
    """Return the encoding and the text of the definition of a message, followed by those of its fields.

    Without a definition file, the encoding is ``unknown``, as in rosbag2; parts of services have none.
    """
    if "/msg/" not in type_name:
        return "unknown", b""
    seen = {type_name}

    def text(name: str) -> str:
        parts = [Path(get_interface_path(name)).read_text(encoding="utf-8")]
        package = name.partition("/")[0]
        used = {type_ for line in parts[0].splitlines() if (type_ := message_type(line, package))}
        for nested in sorted(used):
            if nested not in seen:
                seen.add(nested)
                parts.append(f"{'=' * 80}\nMSG: {nested.replace('/msg/', '/')}\n{text(nested)}")
        return "\n".join(parts)

    try:
        return "ros2msg", text(type_name).encode()
    except LookupError:  # its package came without the files
        return "unknown", b""


def fields(type_name: str, text: str) -> dict[str, list[str]]:
    """Return the fields and constants in a definition, by message: what is left of it without its form."""
    found = {}
    for part in re.split(r"^=+\nMSG: ", f"{'=' * 80}\nMSG: {type_name}\n{text}", flags=re.MULTILINE)[1:]:
        name, *lines = part.splitlines()
        package, _, short = name.strip().partition("/")
        name = f"{package}/msg/{short.removeprefix('msg/')}"
        found[name] = [_field(line, package) for line in lines if line.partition("#")[0].strip()]
    return found


def _field(line: str, package: str) -> str:
    words = " ".join(line.partition("#")[0].split())
    type_ = message_type(words, package)
    return re.sub(r"^[A-Za-z0-9_/]+", type_, words) if type_ else re.sub(r"\s*=\s*", "=", words)
