"""What is said to whoever watches the system: never at the price of the system."""

from __future__ import annotations

import select
import sys
from typing import TextIO


def say(line: str) -> None:
    """
    Print a line to standard output; it is lost where nobody has read for long.

    A pipe that is full, or a terminal that is stopped, would let a print wait for ever: whoever runs the
    system could neither stop it nor revive it. Nothing is said where standard output is closed (`>&-`).
    Raises BrokenPipeError where nobody can read any more.
    """
    output: TextIO | None = sys.stdout
    if output and select.select([], [output], [], 0)[1]:
        print(line, flush=True)
