"""Shows what others have sent on the user's terminal, without obeying it."""

from __future__ import annotations

import re
import sys
import unicodedata
from io import TextIOWrapper

_INVISIBLE = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)
"""Characters that Python takes for printable, but that leave no trace."""


def protect() -> None:
    """Escape what would steer the terminal, or lie there; files and pipes get everything as in ROS 2."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, TextIOWrapper) and stream.isatty():
            shown = _Terminal(stream.buffer, stream.encoding, "backslashreplace", line_buffering=True)
            setattr(sys, name, shown)


class _Terminal(TextIOWrapper):
    def write(self, text: str) -> int:
        super().write("".join(map(_shown, text)) if not text.isascii() or _CONTROL.search(text) else text)
        return len(text)


_CONTROL = re.compile(r"[^\n\t -~]")


def _shown(character: str) -> str:
    if character in "\n\t" or (character.isprintable() and not _INVISIBLE.match(character)):
        return character
    if unicodedata.category(character) == "Zs":
        return " "
    return character.encode("unicode_escape").decode("ascii")
