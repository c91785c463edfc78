"""Handles SIGINT (Ctrl-C) and SIGTERM: they shut down the contexts, and spinning ends.

A thread that waits in DDS does not notice a signal. So Python's C handler writes to a pipe
(``signal.set_wakeup_fd``), and a thread that reads it wakes the executors; then Python can run the handler.
If the main thread does not run it, for example in the event loop of a GUI, the reading thread shuts down.
The same thread wakes the executors when the time of day is set (:mod:`rclpy._clock_steps`).
"""

from __future__ import annotations

import os
import select
import signal
import threading
import time
from collections.abc import Iterable
from enum import IntEnum
from types import FrameType
from typing import TYPE_CHECKING, Any

from rclpy import _clock_steps
from rclpy._listeners import Listeners
from rclpy.guard_condition import GuardCondition

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.executors import Executor


class SignalHandlerOptions(IntEnum):
    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


_executors: Listeners[Executor] = Listeners()
_contexts: Listeners[Context] = Listeners()
_guards: Listeners[GuardCondition] = Listeners()
_previous: dict[int, Any] = {}  # the handlers before ours
_options = SignalHandlerOptions.NO
_wakeup_fd = -1
_HANDLER_TIME = 0.2  # [s], for the main thread to run the handler


class SignalHandlerGuardCondition(GuardCondition):
    """A guard condition that every handled signal triggers."""

    def __init__(self, context: Context | None = None) -> None:
        super().__init__(callback=None, callback_group=None, context=context)
        _guards.add(self)

    def destroy(self) -> None:
        """Destroy it: signals no longer trigger it."""
        _guards.discard(self)
        super().destroy()


def _handle(signum: int, frame: FrameType | None) -> None:
    if not _options and signal.getsignal(signum) is _handle:
        _restore(signum)  # another thread uninstalled the handlers, and could not restore them
        signal.raise_signal(signum)
        return
    _shut_down(_contexts)
    previous = _previous.get(signum)
    if callable(previous):
        previous(signum, frame)


def _shut_down(contexts: Iterable[Context]) -> None:
    for context in contexts:
        context._rclpy_end(by_signal=True)
    for guard in _guards:
        guard.trigger()


def _restore(signum: int) -> None:
    """Restore the previous handler, unless ours was replaced."""
    previous = _previous.pop(signum, None)
    if signal.getsignal(signum) is _handle:
        signal.signal(signum, signal.SIG_DFL if previous is None else previous)


def _wake_executors(signals: int, steps: int | None) -> None:
    """Wake the executors after each signal, and after each step of the time of day."""
    poll = select.poll()
    for fd in (signals, steps):
        if fd is not None:
            poll.register(fd, select.POLLIN)
    while True:
        _wake_executors_once(poll, signals, steps)


def _wake_executors_once(poll: select.poll, signals: int, steps: int | None) -> None:
    # A function of its own: its variables must keep no executor and no context until the next signal.
    ready = [fd for fd, _ in poll.poll()]
    if steps in ready:
        _clock_steps.acknowledge(steps)
    numbers = os.read(signals, 64) if signals in ready else b""
    contexts = [context for context in _contexts if context._rclpy_valid]
    for executor in _executors:
        executor.wake()
    if contexts and any(signal.getsignal(number) is _handle for number in numbers):
        time.sleep(_HANDLER_TIME)
        # Not newer contexts: the program initialized them after the signal.
        left = [context for context in contexts if context._rclpy_valid]
        if left and _options:
            _shut_down(left)


def _listen() -> None:
    """Install the pipe, unless the program has installed its own wake-up file descriptor."""
    global _wakeup_fd
    if threading.current_thread() is not threading.main_thread():
        return
    current = signal.set_wakeup_fd(-1)
    if current not in (-1, _wakeup_fd):
        signal.set_wakeup_fd(current)
        return
    if _wakeup_fd < 0:
        reading, _wakeup_fd = os.pipe()
        os.set_blocking(_wakeup_fd, False)
        sources = (reading, _clock_steps.open_watch())
        threading.Thread(target=_wake_executors, args=sources, name="rclpy-signals", daemon=True).start()
    signal.set_wakeup_fd(_wakeup_fd, warn_on_full_buffer=False)


def _watch(executor: Executor) -> None:
    """Make every signal wake this executor, so that Python runs the handler."""
    _executors.add(executor)
    _listen()


def _shut_down_by_signal(context: Context) -> None:
    _contexts.add(context)


def get_current_signal_handlers_options() -> SignalHandlerOptions:
    """Return the signals that rclpy handles now."""
    return _options


def install_signal_handlers(options: SignalHandlerOptions = SignalHandlerOptions.ALL) -> None:
    """Handle these signals, in addition to those already handled. Has an effect only in the main thread."""
    global _options
    if threading.current_thread() is not threading.main_thread():
        return
    if not _options:
        uninstall_signal_handlers()  # completes a call on another thread
    for number, option in (
        (signal.SIGINT, SignalHandlerOptions.SIGINT),
        (signal.SIGTERM, SignalHandlerOptions.SIGTERM),
    ):
        if options & option and not _options & option:
            _previous[number] = signal.signal(number, _handle)
    _options = SignalHandlerOptions(_options | options)
    _listen()


def uninstall_signal_handlers() -> None:
    """Stop handling signals: restore the previous handlers.

    Only the main thread can do so. After a call on another thread, the next signal restores them, and they
    handle it.
    """
    global _options
    _options = SignalHandlerOptions.NO
    if threading.current_thread() is threading.main_thread():
        for number in list(_previous):
            _restore(number)
