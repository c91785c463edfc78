"""The handlers of SIGINT and SIGTERM: they end all contexts and wake the executors."""

from __future__ import annotations

import signal
import threading
from typing import Any

from rclpy_ground import choice, process
from rclpy_ground.genuine import genuine
from rclpy_ground.waiting import GuardCondition

_SIGNALS = {1: signal.SIGINT, 2: signal.SIGTERM}
"""By their bits in SignalHandlerOptions."""


def handle(number: int, frame: Any) -> None:
    current = process.current
    if not current.signal_options:  # another thread uninstalled the handlers, and could not restore them
        _restore(number)
        signal.raise_signal(number)
        return
    for guard in list(current.signal_guards):
        guard.trigger_guard_condition()
    for reference in current.contexts:
        if (context := reference()) is not None:
            context.invalidate()
    previous = current.previous_handlers.get(number)
    if callable(previous):
        previous(number, frame)


def install_signal_handlers(options: Any) -> None:
    current = process.current
    if threading.current_thread() is threading.main_thread():
        if not current.signal_options:
            uninstall_signal_handlers()  # completes a call on another thread
        for bit, number in _SIGNALS.items():
            if int(options) & bit and not current.signal_options & bit:
                current.previous_handlers[number] = signal.signal(number, handle)
        current.signal_options |= int(options)
        choice.ground.watch_signals()


def uninstall_signal_handlers() -> None:
    """Restore the previous handlers; on another thread than the main one, the next signal restores them."""
    current = process.current
    current.signal_options = 0
    if threading.current_thread() is threading.main_thread():
        for number in list(current.previous_handlers):
            _restore(number)


def _restore(number: int) -> None:
    """Restore the previous handler, unless the program has replaced ours."""
    previous = process.current.previous_handlers.pop(number, None)
    if signal.getsignal(number) is handle:
        signal.signal(number, signal.SIG_DFL if previous is None else previous)


def get_current_signal_handlers_options() -> Any:
    return genuine.SignalHandlerOptions(process.current.signal_options)


def register_sigint_guard_condition(guard: GuardCondition) -> None:
    guard.process = process.current
    guard.process.signal_guards[guard] = None


def unregister_sigint_guard_condition(guard: GuardCondition) -> None:
    if guard.process is None or guard not in guard.process.signal_guards:
        raise ValueError("Guard condition was not registered")
    del guard.process.signal_guards[guard]
