"""Wakes what waits in DDS at each signal and each step of the time of day.

A thread that waits in DDS does not notice a signal. So Python's C handler writes to a pipe
(``signal.set_wakeup_fd``), and a thread that reads it ends the waits; then Python can run the handler.
If the main thread does not run it, for example in the loop of a GUI, the reading thread ends the contexts.

DDS waits until a time of day. When that is set back, a wait would go on for as long as the step: the kernel's
``timerfd`` shows steps (man timerfd_create).
"""

from __future__ import annotations

import ctypes as ct
import os
import select
import signal
import sys
import threading
import time
from contextlib import suppress

from rclpy_ground import process
from rclpy_ground.signals import handle

# Constants of <sys/timerfd.h>, which Python has from 3.13 on.
_TFD_TIMER_ABSTIME, _TFD_TIMER_CANCEL_ON_SET = 1, 2
_HANDLER_TIME = 0.2
"""How long the main thread may take to run the handler [s]."""
_NEVER = min(sys.maxsize, 2**33)  # s since 1970

_reading = _writing = -1


def listen() -> None:
    """Begin to wake the waits, unless the program reads its signals itself. Call it on the main thread.

    Before a new context, call it again: it forgets the signals so far. Python has run their handlers, and
    they must not end the new context.
    """
    global _reading, _writing
    if threading.current_thread() is not threading.main_thread():
        return
    current = signal.set_wakeup_fd(-1)
    if current not in (-1, _writing):
        signal.set_wakeup_fd(current)
        return
    if _writing < 0:
        _reading, _writing = os.pipe()
        for fd in (_reading, _writing):
            os.set_blocking(fd, False)
        sources = (_reading, open_watch())
        threading.Thread(target=_wake, args=sources, name="rclpy-signals", daemon=True).start()
    with suppress(BlockingIOError):
        while os.read(_reading, 64):
            pass
    signal.set_wakeup_fd(_writing, warn_on_full_buffer=False)


def open_watch() -> int:
    """Return a file descriptor that is readable after each step of the time of day."""
    libc = ct.CDLL(None)
    fd: int = libc.timerfd_create(time.CLOCK_REALTIME, os.O_CLOEXEC | os.O_NONBLOCK)
    times = (ct.c_long * 4)(0, 0, _NEVER, 0)  # interval and value, each in seconds and nanoseconds
    libc.timerfd_settime(fd, _TFD_TIMER_ABSTIME | _TFD_TIMER_CANCEL_ON_SET, times, None)
    return fd


def _wake(signals: int, steps: int) -> None:
    poll = select.poll()
    for fd in (signals, steps):
        poll.register(fd, select.POLLIN)
    while True:
        _wake_once(poll, signals)


def _wake_once(poll: select.poll, signals: int) -> None:
    # A function of its own: its variables must keep no context until the next signal.
    numbers = b""
    ready = poll.poll()
    # Before the signals are read: a context that the program makes after them is none of these.
    contexts = [each for reference in process.current.contexts if (each := reference()) and each.is_valid]
    for fd, _ in ready:
        with suppress(OSError):  # ECANCELED: the time of day was set; EAGAIN: the signals were forgotten
            data = os.read(fd, 64)
            numbers += data if fd == signals else b""
    for context in contexts:
        context.wake()
    if any(signal.getsignal(number) is handle for number in numbers):
        time.sleep(_HANDLER_TIME)
        if process.current.signal_options:
            for context in contexts:
                context.invalidate()
