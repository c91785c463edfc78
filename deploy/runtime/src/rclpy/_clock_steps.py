"""Tells when the time of day is set, by the kernel's ``timerfd`` (man timerfd_create).

DDS waits until a time of day. When that is set back, a wait goes on for as long as the step, so executors
have to wait again.
"""

from __future__ import annotations

import ctypes as ct
import os
import sys
import time
from contextlib import suppress

# Constants of <sys/timerfd.h>, which Python has from 3.13 on.
_TFD_TIMER_ABSTIME, _TFD_TIMER_CANCEL_ON_SET = 1, 2
_NEVER = min(sys.maxsize, 2**33)  # s since 1970


def open_watch() -> int | None:
    """Return a file descriptor that is readable after each step of the time of day; ``None`` without one."""
    libc = ct.CDLL(None)
    if not hasattr(libc, "timerfd_create"):
        return None
    fd: int = libc.timerfd_create(time.CLOCK_REALTIME, os.O_CLOEXEC | os.O_NONBLOCK)
    times = (ct.c_long * 4)(0, 0, _NEVER, 0)  # interval and value, each in seconds and nanoseconds
    flags = _TFD_TIMER_ABSTIME | _TFD_TIMER_CANCEL_ON_SET
    return fd if libc.timerfd_settime(fd, flags, times, None) == 0 else None


def acknowledge(fd: int) -> None:
    """Make the file descriptor wait for the next step."""
    with suppress(OSError):  # ECANCELED tells of the step
        os.read(fd, 8)
