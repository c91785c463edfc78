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
        self.listener: Callable[[str], Any] | None = None
        """Is called with each text."""

    def write(self, text: str) -> int:
        """Add text, unless the process has ended."""
        if not self._has_ended:
            if self.listener is not None:
                self.listener(text)
            self._parts.append(text[-_KEPT:])
            self._length += len(self._parts[-1])
            while self._length > _KEPT and len(self._parts) > 1:
                self._length -= len(self._parts.popleft())
        return len(text)

    def end(self) -> None:
        self._has_ended = True

    @property
    def text(self) -> str:
        return "".join(self._parts)
