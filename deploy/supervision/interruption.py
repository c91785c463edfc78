"""Ctrl-C, SIGTERM and a closed terminal: noted at any moment, obeyed where nothing is half done.

A command calls :func:`install` first. It calls :func:`check` between its steps and while it waits, and
:func:`ignore` before it stops the system, so a second Ctrl-C does not interrupt the stop.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_noted = False
_blocking = False
_ignored = False


class Interrupted(Exception):
    """A signal asked this process to end."""


def install() -> None:
    """Note signals from now on. ``make`` blocks SIGINT until here: a starting Python shows a traceback."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number == signal.SIGHUP and signal.getsignal(number) == signal.SIG_IGN:
            continue  # nohup asks for this
        signal.signal(number, _note)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def check() -> None:
    if _noted and not _ignored:
        raise Interrupted


def hand_over() -> None:
    """Block SIGINT for the program that this process executes next, until it calls `install`."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    check()


@contextmanager
def blocking() -> Iterator[None]:
    """Let a signal end a system call that may block forever; nothing else belongs into the block."""
    global _blocking
    _blocking = not _ignored
    try:
        check()
        yield
    finally:
        _blocking = False


def ignore() -> None:
    """Let signals change nothing from now on: this process ends anyway."""
    global _ignored
    _ignored = True


def _note(number: int, frame: FrameType | None) -> None:
    global _noted, _blocking
    _noted = True
    if _blocking:
        _blocking = False  # raises once: the clean-up after it is safe
        raise Interrupted
