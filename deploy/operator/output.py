"""Best-effort output to the user that never blocks for long."""

from __future__ import annotations

import select
import shutil
import sys
from io import TextIOWrapper
from typing import TextIO

from interfaces.plain_text import PlainOutput, plain_lines

PATIENCE = 0.1  # s: a terminal takes nothing for a moment while another thread writes to it
_patience = PATIENCE  # none while the reader is stuck


def use_plain_output() -> None:
    """Make all that is printed plain: text of others must not steer the user's terminal, nor end a command.

    What the output cannot encode is escaped as well, such as θ in Latin-1. A closed output stays closed.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, TextIOWrapper):
            plain = PlainOutput(
                stream.buffer,
                stream.encoding,
                "backslashreplace",
                line_buffering=stream.line_buffering,
                write_through=True,
            )
            setattr(sys, name, plain)


class Area:
    """The last lines of a terminal, drawn again in place; in a file or a pipe, each time below the last."""

    def __init__(self) -> None:
        self._height = 0

    def show(self, text: str) -> None:
        """Show lines in place of those before; in a terminal, they are cut to its width."""
        output = sys.stdout
        if not output or not output.isatty():
            say(f"\n{text}" if self._height else text)
        else:
            if self._height:
                output.flush()
                output.buffer.write(f"\x1b[{self._height}A\x1b[J".encode())
            width = shutil.get_terminal_size().columns - 1
            say("\n".join(line[:width] for line in text.split("\n")))
        self._height = text.count("\n") + 1


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
        print(plain_lines(line), flush=True)  # the prompt prints in its own way
    else:
        _patience = 0.0
