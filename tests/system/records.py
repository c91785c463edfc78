"""What a record of an arm has."""

from __future__ import annotations

from pathlib import Path

from mcap_files import McapFile


def engine_states(path: Path) -> list[str]:
    """The states of the engines in a record. Its recorder may still be writing it."""
    with McapFile(path) as file:
        found = [message.data for _, message in file.messages({"/engines/state"})]
    return [data[8:].rstrip(b"\0").decode() for data in found]
