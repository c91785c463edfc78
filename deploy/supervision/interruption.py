"""Ctrl-C, SIGTERM and a closed terminal: noted at any moment, obeyed where nothing is half done.

A command calls :func:`install` first. It calls :func:`check` between its steps and while it waits, and
:func:`ignore` before it stops the system, so a second Ctrl-C does not interrupt the stop.
"""

from __future__ import annotations

import os
import resource
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
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
    if _is_below_first_make():
        threading.Thread(target=_follow_make, daemon=True).start()


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
    end_make()
    if _blocking:
        _blocking = False  # raises once: the clean-up after it is safe
        raise Interrupted


def end_make() -> None:
    """Let the kernel end a make that is the first process of a container, and that got a signal to end.

    It waits for its commands, then sends the signal to itself. The kernel does not deliver that to the first
    process of a container, so make would loop. With this limit it ends after a second of processor time.
    """
    with suppress(OSError, ValueError):
        if _is_below_first_make():
            resource.prlimit(1, resource.RLIMIT_CPU, (1, 1))


def _is_below_first_make() -> bool:
    """Whether the parent is a make that is the first process of a container."""
    with suppress(OSError):
        return os.getppid() == 1 and Path("/proc/1/comm").read_text() == "make\n"
    return False


def _follow_make() -> None:
    """Pass on the SIGINT of make, which sends it to no child. A terminal would, ``docker run`` does not.

    make catches SIGINT until one has come.
    """
    with suppress(OSError):
        while _catches(1, signal.SIGINT):
            time.sleep(0.2)
    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _catches(pid: int, number: int) -> bool:
    status = Path(f"/proc/{pid}/status").read_text()
    return bool(int(status.partition("SigCgt:")[2].split()[0], 16) >> (number - 1) & 1)
