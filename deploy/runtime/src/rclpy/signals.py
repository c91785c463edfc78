"""What Ctrl-C and SIGTERM do: they shut every context down, and whoever spins returns.

A thread that waits in DDS cannot notice a signal. So the C-level handler of Python writes to a pipe
(``signal.set_wakeup_fd``), and a thread that reads it wakes the executors; then Python runs the handler.
Where the main thread never comes to that, in the event loop of a GUI for instance, that thread shuts down.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterable
from enum import IntEnum
from types import FrameType
from typing import TYPE_CHECKING, Any

from rclpy._listeners import Listeners
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


_executors: Listeners[Executor] = Listeners()
_contexts: Listeners[Context] = Listeners()
_guards: Listeners[GuardCondition] = Listeners()
_previous: dict[int, Any] = {}  # the handlers that were there before ours
_options = SignalHandlerOptions.NO
_wakeup_fd = -1
_TURN = 0.2  # [s] that the main thread has to run a handler


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
    if not _options and signal.getsignal(signum) is _handle:
        _restore(signum)  # uninstalled on another thread, which could not
        signal.raise_signal(signum)
        return
    _shut_down(_contexts)
    previous = _previous.get(signum)
    if callable(previous):
        previous(signum, frame)


def _shut_down(contexts: Iterable[Context]) -> None:
    for context in contexts:
        context._end(by_signal=True)
    for guard in _guards:
        guard.trigger()


def _restore(signum: int) -> None:
    """Put the handler back that was there before ours, unless ours is no longer there."""
    previous = _previous.pop(signum, None)
    if signal.getsignal(signum) is _handle:
        signal.signal(signum, signal.SIG_DFL if previous is None else previous)


def _wake_executors(fd: int) -> None:
    while numbers := os.read(fd, 64):
        contexts = [context for context in _contexts if context._valid]
        for executor in _executors:
            executor.wake()
        if contexts and any(signal.getsignal(number) is _handle for number in numbers):
            time.sleep(_TURN)
            # Not those that have begun since: whoever began them has heard of the signal.
            left = [context for context in contexts if context._valid]
            if left and _options:
                _shut_down(left)


def _listen() -> None:
    """Let the C-level handler wake the executors, unless it has a wake-up fd of somebody else already."""
    global _wakeup_fd
    if threading.current_thread() is not threading.main_thread():
        return
    there = signal.set_wakeup_fd(-1)
    if there not in (-1, _wakeup_fd):
        signal.set_wakeup_fd(there)
        return
    if _wakeup_fd < 0:
        reading, _wakeup_fd = os.pipe()
        os.set_blocking(_wakeup_fd, False)
        threading.Thread(target=_wake_executors, args=(reading,), name="rclpy-signals", daemon=True).start()
    signal.set_wakeup_fd(_wakeup_fd, warn_on_full_buffer=False)


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
    if not _options:
        uninstall_signal_handlers()  # in case that it was called on another thread
    for number, option in (
        (signal.SIGINT, SignalHandlerOptions.SIGINT),
        (signal.SIGTERM, SignalHandlerOptions.SIGTERM),
    ):
        if options & option and not _options & option:
            _previous[number] = signal.signal(number, _handle)
    _options = SignalHandlerOptions(_options | options)
    _listen()


def uninstall_signal_handlers() -> None:
    """
    Handle signals no more: put the handlers back that were there before.

    Only the main thread can. After a call on another one the next signal does it, and is handled by them.
    """
    global _options
    _options = SignalHandlerOptions.NO
    if threading.current_thread() is threading.main_thread():
        for number in list(_previous):
            _restore(number)
