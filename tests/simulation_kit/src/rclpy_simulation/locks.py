"""Locks of simulated programs: a thread that waits for one lets the others run."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any

from rclpy_simulation.process import here, running
from rclpy_simulation.thread import Thread

_QUICK = ("rclpy", "rclpy_ground", "rclpy_simulation", "importlib", "_frozen_importlib")
"""Packages that never wait while they hold a lock of their own: theirs are real, which is faster."""


_OUTSIDE = "the code that runs the simulation"


class Lock:
    """``threading.Lock`` of a simulated program."""

    __slots__ = ("_count", "_owner", "_waiters")
    _is_reentrant = False

    def __init__(self) -> None:
        self._owner: Thread | str | None = None
        self._count = 0
        self._waiters: list[Thread] = []

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        own = here.thread or _OUTSIDE
        if self._owner is not None:
            if self._is_reentrant and self._owner is own:
                self._count += 1
                return True
            if not blocking or not self._wait(None if timeout < 0 else timeout):
                return False
        self._owner, self._count = own, 1
        return True

    def _wait(self, timeout: float | None) -> bool:
        thread = running()
        self._waiters.append(thread)
        try:
            thread.wait_until(lambda: self._owner is None, timeout)
        finally:
            self._waiters.remove(thread)
        return self._owner is None

    def release(self) -> None:
        if self._owner is None:
            raise RuntimeError("release unlocked lock")
        if self._is_reentrant and self._owner is not here.thread and isinstance(self._owner, Thread):
            raise RuntimeError("cannot release un-acquired lock")
        self._count -= 1
        if not self._count:
            self._owner = None
            for thread in self._waiters:
                thread.wake()

    def locked(self) -> bool:
        return self._owner is not None

    def __enter__(self) -> bool:
        if self._owner is None:  # nearly always
            self._owner, self._count = here.thread or _OUTSIDE, 1
            return True
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        if self._count == 1 and not self._waiters and self._owner is here.thread:
            self._owner, self._count = None, 0
        else:
            self.release()


class RLock(Lock):
    """``threading.RLock`` of a simulated program."""

    __slots__ = ()
    _is_reentrant = True

    # As threading.Condition asks for it.

    def _is_owned(self) -> bool:
        return self._owner is (here.thread or _OUTSIDE)

    def _release_save(self) -> int:
        count, self._count = self._count, 1
        self.release()
        return count

    def _acquire_restore(self, count: int) -> None:
        self.acquire()
        self._count = count


def _either(simulated: type[Lock], real: Callable[[], Any]) -> Callable[[], Any]:
    def make() -> Any:
        if here.process is None:
            return real()
        package = sys._getframe(1).f_globals.get("__name__", "").partition(".")[0]
        return real() if package in _QUICK else simulated()

    return make


def replacements() -> list[tuple[Any, str, Any]]:
    return [
        (threading, "Lock", _either(Lock, threading.Lock)),
        (threading, "RLock", _either(RLock, threading.RLock)),
    ]
