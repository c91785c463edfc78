"""What Ctrl-C and SIGTERM do: they shut every context down, and whoever spins returns.

A thread that waits in DDS cannot notice a signal. So the C-level handler of Python writes to a pipe
(``signal.set_wakeup_fd``), and a thread that reads it wakes the executors; then Python runs the handler.
"""

from __future__ import annotations

import os
import signal
import threading
import weakref
from collections.abc import Callable
from enum import IntEnum
from types import FrameType
from typing import TYPE_CHECKING, Any

from rclpy.guard_condition import GuardCondition

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.executors import Executor


class SignalHandlerOptions(IntEnum):
    """Which signals rclpy handles."""

    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


_executors: weakref.WeakSet[Executor] = weakref.WeakSet()
_contexts: weakref.WeakSet[Context] = weakref.WeakSet()
_guards: weakref.WeakSet[GuardCondition] = weakref.WeakSet()
_previous: dict[int, Any] = {}  # the handlers that were there before ours
_options = SignalHandlerOptions.NO
_wakeup_fd = -1


class SignalHandlerGuardCondition(GuardCondition):
    """A guard condition that every handled signal triggers."""

    def __init__(self, context: Context | None = None) -> None:
        super().__init__(callback=None, callback_group=None, context=context)
        _guards.add(self)

    def destroy(self) -> None:
        """Hear of no more signals."""
        _guards.discard(self)
        super().destroy()


def _handle(signum: int, frame: FrameType | None) -> None:
    for context in list(_contexts):
        context.try_shutdown()
    for guard in list(_guards):
        guard.trigger()
    previous = _previous.get(signum)
    if callable(previous):
        previous(signum, frame)


def _wake_executors(fd: int) -> None:
    while os.read(fd, 64):
        for executor in list(_executors):
            executor.wake()


def _listen() -> None:
    """Start the thread that wakes the executors, once; a wake-up fd of somebody else stays in place."""
    global _wakeup_fd
    if _wakeup_fd >= 0 or threading.current_thread() is not threading.main_thread():
        return
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    theirs = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    if theirs >= 0:
        signal.set_wakeup_fd(theirs)
        os.close(reading)
        os.close(writing)
        return
    _wakeup_fd = writing
    threading.Thread(target=_wake_executors, args=(reading,), name="rclpy-signals", daemon=True).start()


def _watch(executor: Executor) -> None:
    """Let every signal end this executor's waiting, so that its handler runs."""
    _executors.add(executor)
    _listen()


def _shut_down_by_signal(context: Context) -> None:
    _contexts.add(context)


def get_current_signal_handlers_options() -> SignalHandlerOptions:
    """Return which signals rclpy handles now."""
    return _options


def install_signal_handlers(options: SignalHandlerOptions = SignalHandlerOptions.ALL) -> None:
    """Handle the signals that ``options`` name, besides those handled already. Only the main thread can."""
    global _options
    if threading.current_thread() is not threading.main_thread():
        return
    for number, option in (
        (signal.SIGINT, SignalHandlerOptions.SIGINT),
        (signal.SIGTERM, SignalHandlerOptions.SIGTERM),
    ):
        if options & option and not _options & option:
            _previous[number] = signal.signal(number, _handle)
    _options = SignalHandlerOptions(_options | options)
    _listen()


def uninstall_signal_handlers() -> None:
    """Put the handlers back that were there before."""
    global _options
    if threading.current_thread() is not threading.main_thread():
        return
    restore: Callable[[int, Any], Any] = signal.signal
    for number in list(_previous):
        previous = _previous.pop(number)
        if signal.getsignal(number) is _handle:
            restore(number, signal.SIG_DFL if previous is None else previous)
    _options = SignalHandlerOptions.NO
