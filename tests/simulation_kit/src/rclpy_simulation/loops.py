"""asyncio in simulated programs: its event loops wait in virtual time."""

from __future__ import annotations

import selectors
import signal
from asyncio import events, unix_events
from asyncio.selector_events import BaseSelectorEventLoop
from collections.abc import Callable, Mapping
from typing import Any

from rclpy_simulation.process import here, running
from rclpy_simulation.refusals import NotSimulatedError
from rclpy_simulation.thread import Thread


class Selector(selectors.BaseSelector):
    """Waits until another thread, a signal or a time wakes its loop; there is no file to wait for."""

    def __init__(self) -> None:
        self._thread: Thread | None = None
        self._is_woken = False

    def wake(self) -> None:
        self._is_woken = True
        if self._thread is not None:
            self._thread.wake()

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        self._thread = thread = running()
        if timeout is not None and timeout <= 0:
            thread.note_empty_wait()
        elif not self._is_woken:
            thread.wait_until(lambda: self._is_woken, timeout)
        self._is_woken = False
        return []

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        raise NotSimulatedError("a file or socket in an event loop of asyncio")

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        raise KeyError(fileobj)

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return {}


def _in_loop(simulated: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of loops: the real one for a loop of code that is not simulated."""

    def call(loop: Any, *arguments: Any) -> Any:
        is_simulated = isinstance(loop._selector, Selector)
        return (simulated if is_simulated else real)(loop, *arguments)

    return call


def _make_no_pipe(loop: Any) -> None:
    loop._ssock = loop._csock = None
    # Of the loop itself: it may be closed after the simulation.
    loop._close_self_pipe = lambda: None
    loop._write_to_self = loop._selector.wake


def _add_signal_handler(loop: Any, number: int, callback: Callable[..., Any], *arguments: Any) -> None:
    handle = events.Handle(callback, arguments, loop, None)
    loop._signal_handlers[number] = handle
    signal.signal(number, lambda *_: loop._add_callback_signalsafe(handle))


def replacements() -> list[tuple[Any, str, Any]]:
    base, unix = BaseSelectorEventLoop, unix_events._UnixSelectorEventLoop
    real = selectors.DefaultSelector
    methods: list[tuple[Any, str, Callable[..., Any]]] = [
        (base, "_make_self_pipe", _make_no_pipe),
        (unix, "add_signal_handler", _add_signal_handler),
    ]
    return [
        (selectors, "DefaultSelector", lambda: real() if here.process is None else Selector()),
        *((owner, name, _in_loop(simulated, getattr(owner, name))) for owner, name, simulated in methods),
    ]
