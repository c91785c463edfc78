"""How generated code is run."""

from __future__ import annotations

from typing import Any


def run(code: str, names: dict[str, Any]) -> None:
    """
    Run generated code, which defines its names among ``names``.

    It is compiled apart: of a text, CPython remembers a Ctrl-C that comes just then, and ends the program by
    it although that has caught it.
    """
    exec(compile(code, "<generated>", "exec"), names)
