"""Plain lines for pipes, files and terminals without a movable cursor."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Iterable, Sequence

from deploy.operator.output import say


class PlainLines:
    def __init__(self) -> None:
        """Read standard input, unless it is closed."""
        self._input = None if sys.stdin is None else sys.stdin.fileno()
        self.takes_input = self._input is not None
        """Whether somebody can still type."""
        self._is_terminal = self._input is not None and os.isatty(self._input)  # after a hang-up, no
        self._typed = b""

    def show(self, lines: Iterable[str]) -> None:
        """Print lines; drop those for which a pipe or terminal has no room."""
        for line in lines:
            say(line)

    def show_state(self, parts: Sequence[tuple[str, str]]) -> None:
        """Nothing: a line that changes would fill a file or a pipe."""

    def read(self, seconds: float) -> list[str]:
        """Return typed lines as soon as there are any; wait at most so long [s]. EOFError after Ctrl-D."""
        if self._input is None:
            time.sleep(seconds)
            return []
        if not select.select([self._input], [], [], seconds)[0]:
            return []
        try:
            typed = os.read(self._input, 1024)
        except OSError:  # the terminal belongs to another job now
            self.takes_input = False
            time.sleep(seconds)
            return []
        self.takes_input = bool(typed)
        if not typed:
            self._input = None
            if self._is_terminal:  # the end of a file or a pipe ends only what needs a hand
                raise EOFError
            typed = b"\n" if self._typed else b""  # which the last line may lack
        *lines, self._typed = (self._typed + typed).split(b"\n")
        return [line.decode(errors="replace") for line in lines]

    def close(self) -> None:
        """Leave the terminal as it was."""
