"""How the monkey's own messages and processes are told from those of the arm."""

from __future__ import annotations

import struct

from interfaces import topics

_MARK = 0x7FF8_BAB1_EBAB_1E00
_NANS = {topic.name: struct.pack("<Q", _MARK + number) for number, topic in enumerate(topics.CONTRACT)}
BABBLER = "babbler"
"""What a babbler's process is called among those of the arm: none of its programs, nor its supervisord."""
TEXT = "babble"
_TEXT = struct.pack("<I", len(TEXT) + 1) + TEXT.encode() + b"\0"  # as a string of CDR, not as a part of one
GARBAGE = b"\x00\xba\xbb\x1e"
"""The first bytes, after the header, of what nobody can read: a released switch, an endless text."""


def nan(topic: topics.Topic) -> float:
    """Not a number, with a mark in it: the topic's own, as arithmetic keeps that of what came in."""
    number: float = struct.unpack("<d", _NANS[topic.name])[0]
    return number


def is_babble(topic: topics.Topic, data: bytes) -> bool:
    """Whether the monkey wrote this serialized message on a topic."""
    return data[4:8] == GARBAGE or _NANS[topic.name] in data or _TEXT in data
