"""Best-effort output to the user that never blocks for long."""

from __future__ import annotations

import select
import sys
from io import TextIOWrapper
from typing import TextIO

PATIENCE = 0.1  # s: a terminal takes nothing for a moment while another thread writes to it
_patience = PATIENCE  # none while the reader is stuck


def accept_any_text() -> None:
    """Escape what standard output cannot encode, such as θ in Latin-1: no text may end a command."""
    if isinstance(sys.stdout, TextIOWrapper):  # it may be closed
        sys.stdout.reconfigure(errors="backslashreplace")


def say(line: str) -> None:
    """Print a line to standard output; drop it if its reader is stuck, so that stop and revival never wait.

    Nothing is printed if standard output is closed (`>&-`). Raises BrokenPipeError if a pipe has no reader.
    """
    global _patience
    output: TextIO | None = sys.stdout
    if not output:
        return
    if select.select([], [output], [], _patience)[1]:
        _patience = PATIENCE
        print(line, flush=True)
    else:
        _patience = 0.0
