"""The operator's terminal: a prompt if it can show one, plain lines elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

from deploy.console.plain import PlainTerminal


class Terminal(Protocol):
    """Shows lines and reads typed ones."""

    def show(self, lines: Iterable[str]) -> None:
        """Print lines; never block."""

    def read(self, seconds: float) -> list[str]:
        """
        Return typed lines as soon as there are any; wait at most so long [s].

        :raises EOFError: if the user has ended the input (Ctrl-D).
        """

    def close(self) -> None:
        """Leave the terminal as it was."""


def open_terminal(words: Sequence[str]) -> Terminal:
    """Return the terminal of this process."""
    return PlainTerminal()
