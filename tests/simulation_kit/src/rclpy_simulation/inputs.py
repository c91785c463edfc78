"""Standard input of simulated programs: a terminal at which the test types."""

from __future__ import annotations

import copy
import io
import os
import select
import sys
import termios
import tty
from collections.abc import Callable
from typing import Any

from rclpy_simulation.process import Process, here, in_process, running
from rclpy_simulation.refusals import NotSimulatedError
from rclpy_simulation.thread import Thread

_ATTRIBUTES: list[Any] = [0, 0, 0, 0, 0, 0, [b"\0"] * 32]
_FILE = 0  # the descriptor of standard input


class Input(io.TextIOBase):
    """Standard input of a process. Nobody types until the test does: a thread that reads waits, no other."""

    def __init__(self) -> None:
        self._text = ""
        self._is_closed = False
        self._waiting: list[Thread] = []

    def type(self, text: str) -> None:
        """Type a text; ``\\n`` is Enter."""
        self._text += text
        self._wake()

    def end(self) -> None:
        """Type Ctrl-D: the input ends after what was typed."""
        self._is_closed = True
        self._wake()

    def _wake(self) -> None:
        for thread in self._waiting:
            thread.wake()

    def wait(self, is_enough: Callable[[], bool], timeout: float | None = None) -> bool:
        """Let the running thread wait until there is enough text, or the end."""
        thread = running()
        self._waiting.append(thread)
        try:
            thread.wait_until(lambda: self._is_closed or is_enough(), timeout)
        finally:
            self._waiting.remove(thread)
        return self._is_closed or is_enough()

    def wait_for_any(self, timeout: float | None = None) -> bool:
        return self.wait(lambda: bool(self._text), timeout)

    def _take(self, size: int) -> str:
        text, self._text = self._text[:size], self._text[size:]
        return text

    def read(self, size: int | None = -1) -> str:
        if size is None or size < 0:
            self.wait(lambda: False)
            return self._take(len(self._text))
        self.wait(lambda: len(self._text) >= size)
        return self._take(size)

    def readline(self, size: int = -1) -> str:  # type: ignore[override]
        self.wait(lambda: "\n" in self._text)
        end = self._text.find("\n") + 1 or len(self._text)
        return self._take(end if size < 0 else min(end, size))

    def readable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return _FILE


def _is_input(file: Any) -> bool:
    return file is sys.stdin or file == _FILE


def _of_terminal(answer: Any, real: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of ``termios``: the simulated terminal accepts all, and has no modes."""

    def call(file: Any, *arguments: Any) -> Any:
        return (
            real(file, *arguments) if here.process is None or not _is_input(file) else copy.deepcopy(answer)
        )

    return call


def _select(process: Process, reading: Any, writing: Any, failing: Any, timeout: float | None = None) -> Any:
    if writing or failing or not all(map(_is_input, reading)):
        raise NotSimulatedError("select.select for other files than sys.stdin")
    if not reading:
        running().wait_until(lambda: False, timeout)
        return [], [], []
    return (list(reading) if process.input.wait_for_any(timeout) else []), [], []


def _read(process: Process, file: int, size: int) -> bytes:
    if file != _FILE:
        return _really_read(file, size)
    process.input.wait_for_any()
    return process.input.read(min(size, max(1, len(process.input._text)))).encode()


_really_read = os.read


def replacements() -> list[tuple[Any, str, Any]]:
    return [
        (select, "select", in_process(_select, select.select)),
        (os, "read", in_process(_read, os.read)),
        (termios, "tcgetattr", _of_terminal(_ATTRIBUTES, termios.tcgetattr)),
        *((termios, name, _of_terminal(None, getattr(termios, name))) for name in ("tcsetattr", "tcflush")),
        *((tty, name, _of_terminal(_ATTRIBUTES, getattr(tty, name))) for name in ("setraw", "setcbreak")),
    ]
