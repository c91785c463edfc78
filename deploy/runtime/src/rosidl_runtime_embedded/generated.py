"""Runs generated code."""

from __future__ import annotations

from typing import Any


def run(code: str, names: dict[str, Any]) -> None:
    """Run generated code, which defines its names in ``names``.

    ``exec`` gets compiled code: from a text, CPython remembers a Ctrl-C during the call, and later ends the
    program with it, although the program has caught it.
    """
    exec(compile(code, "<generated>", "exec"), names)
