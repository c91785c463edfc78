"""The display of the terminal: a prompt if it can show one, plain lines elsewhere."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Protocol

from deploy.operator.terminal.plain import PlainLines


class Display(Protocol):
    takes_input: bool
    """Whether somebody can still type."""

    def show(self, lines: Iterable[str]) -> None:
        """Print lines; never block."""

    def show_state(self, parts: Sequence[tuple[str, str]]) -> None:
        """Keep a line with these parts in view, if that is possible: how each looks, and its text."""

    def read(self, seconds: float) -> list[str]:
        """Return typed lines as soon as there are any; wait at most so long [s]. EOFError after Ctrl-D."""

    def close(self) -> None:
        """Leave the terminal as it was."""


def open_display(words: Sequence[str]) -> Display:
    """Return the display of this process; a prompt completes the words."""
    if not _takes_a_prompt():
        return PlainLines()
    from deploy.operator.terminal.prompt import Prompt  # loads prompt_toolkit: 0.1 s

    return Prompt(words)


def _takes_a_prompt() -> bool:
    """Whether this process is in the foreground of a terminal with a movable cursor."""
    if not (os.isatty(0) and os.isatty(1)) or os.environ.get("TERM", "") in ("", "dumb", "unknown"):
        return False
    with suppress(OSError):  # it is not our controlling terminal
        return os.tcgetpgrp(0) == os.getpgrp()
    return False
