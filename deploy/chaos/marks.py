"""How the monkey's own messages are told from those of the services."""

from __future__ import annotations

import struct

_NAN = struct.pack("<Q", 0x7FF8_BAB1_EBAB_1E00)
NAN: float = struct.unpack("<d", _NAN)[0]
"""Not a number, with the monkey's mark in it."""
TEXT = "babble"
GARBAGE = b"\x00\xba\xbb\x1e"
"""The first bytes, after the header, of what nobody can read: a released switch, an endless text."""


def is_babble(data: bytes) -> bool:
    """Whether the monkey wrote this serialized message."""
    return data[4:8] == GARBAGE or _NAN in data or TEXT.encode() in data
