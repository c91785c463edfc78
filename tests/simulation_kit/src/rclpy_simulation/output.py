"""What simulated processes print."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable
from typing import Any

_KEPT = 64 * 1024  # characters


class Output(io.TextIOBase):
    """Standard output and error of a process; the latest part is kept."""

    def __init__(self) -> None:
        self._parts: deque[str] = deque()
        self._length = 0
        self._has_ended = False
        self._line = ""
        self.listener: Callable[[str], Any] | None = None
        """Is called with each line that is not empty."""

    def write(self, text: str) -> int:
        """Add text, unless the process has ended."""
        if not self._has_ended:
            if self.listener is not None:
                *lines, self._line = (self._line + text).split("\n")
                for line in filter(str.strip, lines):
                    self.listener(line)
            self._parts.append(text[-_KEPT:])
            self._length += len(self._parts[-1])
            while self._length > _KEPT and len(self._parts) > 1:
                self._length -= len(self._parts.popleft())
        return len(text)

    def end(self) -> None:
        if self.listener is not None and self._line.strip():
            self.listener(self._line)
        self._has_ended = True

    @property
    def text(self) -> str:
        return "".join(self._parts)
