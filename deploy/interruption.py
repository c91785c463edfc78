"""Ctrl-C, SIGTERM and a closed terminal ask for the end; `check` tells where that is convenient.

Importing this module is the first thing that a command does. A signal in the middle of a start must not leave
half of it undone, nor a second Ctrl-C interrupt the stop that the first one began.
"""

from __future__ import annotations

import signal
from types import FrameType

_noted = False


class Interrupted(Exception):
    """The end was asked for."""


def check() -> None:
    """Raise Interrupted if the end was asked for."""
    if _noted:
        raise Interrupted


def _note(number: int, frame: FrameType | None) -> None:
    global _noted
    _noted = True


for _number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(_number, _note)
# In the background, reading the terminal shall fail and not stop the process.
signal.signal(signal.SIGTTIN, signal.SIG_IGN)
