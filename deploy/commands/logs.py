"""The lines of `make logs`: those of all files, in the order of their times."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Generator, Iterable
from contextlib import suppress
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import BinaryIO, NamedTuple

LATEST = 10  # lines of each file
WAIT = 0.1  # s
TAIL = 65536  # bytes at the end of a file in which the latest lines are looked for
_STAMP = re.compile(rb"\[(\d+)\.(\d{3})\d*\]")
_DATE = re.compile(rb"(?:-+ )?(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)(?:,(\d{3}))?")
_NAME = 18  # characters: the longest name of a program, and a space


class Line(NamedTuple):
    time: float
    """When it was written [s since 1970]; for a line without a time, that of the line before it."""
    file: str
    text: bytes


class LogFile:
    """A file that grows. Its writer may empty it, or replace it by another one."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: BinaryIO | None = None
        self._rest = b""
        self._time = 0.0

    def latest(self) -> list[Line]:
        """Return the last whole lines, and read on after them."""
        self._open()
        begin = max(0, self._file.seek(0, os.SEEK_END) - TAIL) if self._file else 0
        if self._file:
            self._file.seek(begin)
        return self._read()[begin > 0 :][-LATEST:]  # the first one may be a part

    def new(self) -> list[Line]:
        """Return the lines since the last look."""
        lines = self._read()
        if self._is_another():
            self._open()
            lines += self._read()
        return lines

    def close(self) -> None:
        if self._file:
            self._file.close()

    def _open(self) -> None:
        self.close()
        self._rest = b""
        with suppress(OSError):  # it is not there for a moment
            self._file = self._path.open("rb")

    def _is_another(self) -> bool:
        try:
            found = self._path.stat()
        except OSError:
            return False
        if not self._file:
            return True
        return found.st_ino != os.fstat(self._file.fileno()).st_ino or found.st_size < self._file.tell()

    def _read(self) -> list[Line]:
        data = self._file.read() if self._file else b""
        *whole, self._rest = (self._rest + data).split(b"\n")
        return [self._line(text) for text in whole]

    def _line(self, text: bytes) -> Line:
        if stamp := _STAMP.search(text):
            self._time = int(stamp[1]) + int(stamp[2]) / 1000
        elif date := _DATE.match(text):
            self._time = datetime.fromisoformat(date[1].decode()).timestamp() + int(date[2] or 0) / 1000
        return Line(self._time, self._path.stem, text)


def follow(paths: Iterable[Path]) -> Generator[Line | None, None, None]:
    """Emit the latest lines of files and all that are written to them; ``None`` after each ``WAIT``."""
    files = [LogFile(path) for path in paths]
    try:
        yield from _in_order(file.latest() for file in files)
        while True:
            yield None
            time.sleep(WAIT)
            yield from _in_order(file.new() for file in files)
    finally:
        for file in files:
            file.close()


def _in_order(lines: Iterable[list[Line]]) -> list[Line]:
    return sorted(chain.from_iterable(lines), key=lambda line: line.time)


def readable(line: Line) -> bytes:
    """Return a line after the name of its file, with its time in local time instead of seconds since 1970."""

    def local(stamp: re.Match[bytes]) -> bytes:
        return f"[{datetime.fromtimestamp(int(stamp[1]))},{stamp[2].decode()}]".encode()

    return f"{line.file:<{_NAME}} ".encode() + _STAMP.sub(local, line.text, count=1)
