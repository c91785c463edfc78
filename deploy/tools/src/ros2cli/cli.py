"""Runs a command: its errors become one line and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING, NoReturn, cast

from ros2cli import terminal

if TYPE_CHECKING:
    from io import TextIOWrapper
    from types import FrameType


def main() -> int:
    """Run the command in ``sys.argv``.

    :return: 0; 1 for an error of the command or a closed pipe; 2 for wrong arguments and, as in ROS 2, the
        number of the signal that ended it: 2 for Ctrl-C, 15 for SIGTERM.
    """
    try:
        signal.signal(signal.SIGTERM, _end)
        signal.signal(signal.SIGINT, _end)  # a script's background jobs ignore it
        cast("TextIOWrapper", sys.stdout).reconfigure(line_buffering=True)
        terminal.protect()
        return _run()
    except KeyboardInterrupt:
        return signal.SIGINT
    except BrokenPipeError:
        os.dup2(
            os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
        )  # the interpreter flushes it at its end
        return 1


def _end(number: int, frame: FrameType | None) -> NoReturn:
    """End the command by an exception; objects that were not complete yet end without a complaint."""
    sys.unraisablehook = lambda _: None
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(number)


def _run() -> int:
    # not before `main`, which turns a Ctrl-C during the import into an exit code
    import click

    from ros2cli.commands import ros2

    try:
        with ros2.make_context("ros2", sys.argv[1:]) as context:
            ros2.invoke(context)
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.UsageError as error:
        error.show()
        return error.exit_code
    except (click.ClickException, RuntimeError) as error:
        print(*str(error).split(), file=sys.stderr)  # in one line
        return 1
    return 0
