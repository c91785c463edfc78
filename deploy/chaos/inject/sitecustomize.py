"""Loaded by the interpreter of every supervised process in the arena: signals that break it from inside.

A signal's handler runs on the main thread, which in a service is the executor's: what it does, happens to the
recipe. This directory stands on the PYTHONPATH of systems that the monkey started, and of no other.
"""

import os
import signal
from types import FrameType


def hang(number: int, frame: FrameType | None) -> None:
    """An endless loop inside a callback."""
    while True:
        pass


def fail(number: int, frame: FrameType | None) -> None:
    """An error that nobody expects."""
    raise RuntimeError("the chaos monkey was here")


def hog(number: int, frame: FrameType | None) -> None:
    """Take memory until there is no more."""
    hoard = []
    while True:
        hoard.append(bytearray(4 << 20))


if "SUPERVISOR_PROCESS_NAME" in os.environ:
    signal.signal(signal.SIGUSR1, hang)
    signal.signal(signal.SIGUSR2, fail)
    signal.signal(signal.SIGRTMIN, hog)
