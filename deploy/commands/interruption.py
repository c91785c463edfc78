"""Ctrl-C, SIGTERM and a closed terminal ask for the end; `check` tells where that is convenient.

Importing this module is the first thing that a command does. A signal in the middle of a start must not leave
half of it undone, nor a second Ctrl-C interrupt the stop that the first one began.

The end is also asked for when whoever started this process is gone, or is a `make` that was signalled alone
(by `kill`, not at a terminal): on SIGINT and SIGHUP make waits for its children and does not tell them.
"""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from types import FrameType

PARENT_INTERVAL = 0.2  # s between two looks at the parent


_parent = os.getppid()
_noted = False
_looked = 0.0


class Interrupted(Exception):
    """The end was asked for."""


def check() -> None:
    """Raise Interrupted if the end was asked for."""
    global _looked
    now = time.monotonic()
    if now - _looked > PARENT_INTERVAL:
        _looked = now
        if os.getppid() != _parent or _caught_by_make() != _caught_at_first:
            raise Interrupted
    if _noted:
        raise Interrupted


def _note(number: int, frame: FrameType | None) -> None:
    global _noted
    _noted = True


def _caught_by_make() -> int:
    """The signals that a parent make handles, as the kernel's mask; it no longer does when one has come."""
    try:
        if Path(f"/proc/{_parent}/comm").read_text().strip() not in ("make", "gmake"):
            return 0
        return int(Path(f"/proc/{_parent}/status").read_text().partition("SigCgt:")[2].split()[0], 16)
    except OSError:
        return 0


for _number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    if _number == signal.SIGHUP and signal.getsignal(_number) == signal.SIG_IGN:
        continue  # which is what nohup asks for
    signal.signal(_number, _note)
# In the background, reading the terminal shall fail and not stop the process.
signal.signal(signal.SIGTTIN, signal.SIG_IGN)
_caught_at_first = _caught_by_make()
