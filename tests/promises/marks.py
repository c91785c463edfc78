"""Marks of the monkey in a record: of what the monkey sent itself, and of steps of the time of day."""

from __future__ import annotations

import struct

from interfaces import topics

BABBLER = "babbler"
"""The program name of a babbler's process, which is neither a program of the arm nor supervisord."""
STEP = "step_clock"
"""The kind of fault that steps the time of day."""
SPREAD = 1.0  # s within which a step reaches all processes
TEXT = "babble"
_CDR_TEXT = struct.pack("<I", len(TEXT) + 1) + TEXT.encode() + b"\0"  # the whole string, not a part of one
_NANS = {
    topic.name: struct.pack("<Q", 0x7FF8_BAB1_EBAB_1E00 + number)
    for number, topic in enumerate(topics.CONTRACT)
}
GARBAGE = b"\x00\xba\xbb\x1e"
"""The first bytes of an unreadable message after the CDR header: as a bool false, as a length too big."""


def nan(topic: topics.Topic) -> float:
    """Return a NaN that marks a topic. Arithmetic keeps the mark, so each topic has another one."""
    number: float = struct.unpack("<d", _NANS[topic.name])[0]
    return number


def is_babble(topic: topics.Topic, data: bytes) -> bool:
    """Return whether a babbler wrote this serialized message on a topic."""
    return data[4:8] == GARBAGE or _NANS[topic.name] in data or _CDR_TEXT in data
