"""Measures how long the whole machine stood still, for promises within a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_INTERVAL = 0.01  # [s]
_USUAL = 0.01  # [s] by which a sleeping thread may be late on a busy machine


class Pauses:
    def __init__(self) -> None:
        self.total = 0.0
        """[s]"""
        self._end = threading.Event()

    def watch(self) -> None:
        while not self._end.is_set():
            begin = time.monotonic()
            time.sleep(_INTERVAL)
            late = time.monotonic() - begin - _INTERVAL
            if late > _USUAL:
                self.total += late

    def end(self) -> None:
        self._end.set()


@contextmanager
def watched() -> Iterator[Pauses]:
    pauses = Pauses()
    watcher = threading.Thread(target=pauses.watch)
    watcher.start()
    try:
        yield pauses
    finally:
        pauses.end()
        watcher.join()
