"""Signal handlers that break a process from inside; Python imports them when it starts.

A handler runs on the main thread, which in a service is the executor's: it breaks the recipe. Only the
testbed puts this directory on the PYTHONPATH of a system.
"""

import os
import select
import signal
import time
from types import FrameType


def hang(number: int, frame: FrameType | None) -> None:
    while True:
        pass


def fail(number: int, frame: FrameType | None) -> None:
    raise RuntimeError("injected by the chaos monkey")


def hog(number: int, frame: FrameType | None) -> None:
    hoard = []
    while True:
        hoard.append(bytearray(4 << 20))


def sleep(seconds: float) -> None:
    """Stands in for `time.sleep`, which fails with libfaketime 0.9.10."""
    select.select((), (), (), seconds)


if "SUPERVISOR_PROCESS_NAME" in os.environ:
    signal.signal(signal.SIGUSR1, hang)
    signal.signal(signal.SIGUSR2, fail)
    signal.signal(signal.SIGRTMIN, hog)
if "FAKETIME_TIMESTAMP_FILE" in os.environ:
    time.sleep = sleep  # type: ignore[assignment] # of a narrower type
