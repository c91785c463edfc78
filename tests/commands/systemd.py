"""Reads the words of a unit as systemd does (systemd.service(5), "Command lines")."""

from __future__ import annotations

import shlex


def command_of(unit: str) -> list[str]:
    (line,) = _values(unit, "ExecStart")
    return [_plain(word, "%$") for word in shlex.split(line)]


def environment_of(unit: str) -> dict[str, str]:
    words = [_plain(*shlex.split(line), "%") for line in _values(unit, "Environment")]
    return {name: value for name, _, value in (word.partition("=") for word in words)}


def _values(unit: str, name: str) -> list[str]:
    return [line.removeprefix(f"{name}=") for line in unit.splitlines() if line.startswith(f"{name}=")]


def _plain(word: str, marks: str) -> str:
    """Return a word without its doubled marks; a single one would stand for something else."""
    for mark in marks:
        parts = word.split(2 * mark)
        assert not any(mark in part for part in parts), word
        word = mark.join(parts)
    return word
