"""Best-effort console output that never blocks."""

from __future__ import annotations

import select
import sys
from typing import TextIO


def say(line: str) -> None:
    """
    Print a line to standard output; drop it if the reader is stuck.

    A print to a full pipe or a stopped terminal would wait for its reader, and the system could neither be
    stopped nor revived meanwhile. Nothing is printed if standard output is closed (`>&-`).

    :raises BrokenPipeError: if the pipe has no reader any more.
    """
    output: TextIO | None = sys.stdout
    if output and select.select([], [output], [], 0)[1]:
        print(line, flush=True)
