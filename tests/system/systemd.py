"""Reads the words of a unit as systemd does (systemd.service(5), "Command lines"; systemd.syntax(7))."""

from __future__ import annotations

import re

_ESCAPES = {"n": "\n", "r": "\r"}
"""What stands for another character than itself after a backslash."""


def command_of(unit: str) -> list[str]:
    (line,) = _values(unit, "ExecStart")
    return [_plain(word, "%$") for word in _words(line)]


def environment_of(unit: str) -> dict[str, str]:
    words = [_plain(*_words(line), "%") for line in _values(unit, "Environment")]
    return {name: value for name, _, value in (word.partition("=") for word in words)}


def _values(unit: str, name: str) -> list[str]:
    return [line.removeprefix(f"{name}=") for line in unit.splitlines() if line.startswith(f"{name}=")]


def _words(line: str) -> list[str]:
    """Return the words of a line, all of which are in quotes."""
    quoted = r'"((?:[^"\\]|\\.)*)"'
    assert re.fullmatch(f"{quoted}(?: {quoted})*", line), line
    return [
        re.sub(r"\\(.)", lambda mark: _ESCAPES.get(mark[1], mark[1]), word)
        for word in re.findall(quoted, line)
    ]


def _plain(word: str, marks: str) -> str:
    """Return a word without its doubled marks; a single one would stand for something else."""
    for mark in marks:
        parts = word.split(2 * mark)
        assert not any(mark in part for part in parts), word
        word = mark.join(parts)
    return word
