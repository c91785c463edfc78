"""The layout of values in XCDR1: sizes, alignment, and the ``struct`` formats of runs of values.

Source: DDS-XTypes 1.3, 7.4.1 (plain CDR, version 1). A sample begins with a header of 4 bytes; alignment
counts from its end. ROS 2 Jazzy sends little-endian samples on all machines for which Cyclone DDS is
distributed.
"""

from __future__ import annotations

from struct import Struct
from typing import TYPE_CHECKING, NamedTuple

from .definition_files import message_definition
from .fields import ARRAY_CODES

if TYPE_CHECKING:
    from .definition import Field, MessageDefinition

HEADER_SIZE = 4
LITTLE_ENDIAN_CDR = 0x0100
"""The first two bytes of the header, 00 01, as a little-endian number. The other two are ignored."""

CODES = {**ARRAY_CODES, "boolean": "?", "octet": "c"}
"""Codes of ``struct`` by IDL primitive."""
SIZES = {base: Struct(f"={code}").size for base, code in CODES.items()}
"""Size of an IDL primitive [bytes], which is also its alignment."""


class Item(NamedTuple):
    format: str
    """Its ``struct`` format."""
    size: int
    alignment: int = 1
    value: str = ""
    """Python expression of the value to write, or name for the value to read; empty for padding."""


def run_format(run: list[Item], position: int) -> tuple[str, int]:
    """``struct`` format of a run that begins at a position (header included), and the position of its end."""
    parts = ["<"]
    for item in run:
        padding = (HEADER_SIZE - position) % item.alignment
        if padding:
            parts.append(f"{padding}x")
        parts.append(item.format)
        position += padding + item.size
    return "".join(parts), position


def run_alignment(run: list[Item]) -> int:
    """Greatest alignment in a run; the format of the run depends on its position modulo this."""
    return max(item.alignment for item in run)


def smallest_size(definition: MessageDefinition) -> int:
    """Minimum size of a message on the wire without padding [bytes]."""
    return sum(_smallest_field(field) for field in definition.members)


def _smallest_field(field: Field) -> int:
    type_ = field.type
    if type_.is_sequence:
        return 4
    element = smallest_size(message_definition(type_.base)) if type_.is_message else SIZES.get(type_.base, 4)
    return element * (type_.array_size or 1)
