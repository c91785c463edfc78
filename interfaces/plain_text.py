"""Makes text of others plain: what another process or user wrote must not steer a terminal, or lie.

Needs only the standard library of Python.
"""

from __future__ import annotations

import codecs
import re
import unicodedata
from io import TextIOWrapper

LONGEST = 1000
"""Characters of a text of others that are shown."""
_INVISIBLE = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)
"""Characters that Python takes for printable, but that leave no trace."""


def plain(text: str) -> str:
    """Return a text as one line that shows all its characters, cut if it is too long.

    Escaped are control characters (C0, DEL, C1), ends of lines, direction marks, zero-width characters, and
    what is no text (lone surrogates).
    """
    return _escaped(text if len(text) <= LONGEST else f"{text[:LONGEST]}…")


def plain_lines(text: str) -> str:
    """Return a text in the same way, but with its lines and tabs, and uncut."""
    return re.sub("[^\n\t]+", lambda found: _escaped(found[0]), text)


def _escaped(text: str) -> str:
    if text.isprintable() and not _INVISIBLE.search(text):
        return text
    return "".join(map(_shown, text))


def _shown(character: str) -> str:
    if character.isprintable() and not _INVISIBLE.match(character):
        return character
    if unicodedata.category(character) == "Zs":
        return " "
    return character.encode("unicode_escape").decode("ascii")


class PlainOutput(TextIOWrapper):
    """A text stream to the user: everything that is printed there is plain, wherever it comes from."""

    def write(self, text: str) -> int:
        super().write(plain_lines(text))
        return len(text)


class PlainBytes:
    """Makes a stream of bytes plain, such as the output of a program for its log."""

    def __init__(self) -> None:
        self._decoder = codecs.getincrementaldecoder("utf-8")("backslashreplace")

    def __call__(self, data: bytes) -> bytes:
        """Return what is known by now: the last character may not be whole."""
        return plain_lines(self._decoder.decode(data)).encode()
