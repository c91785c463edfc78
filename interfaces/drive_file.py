"""The file of a drive: that of a GPIO, a serial line, or a named pipe."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import termios
from contextlib import suppress

from interfaces.service import UserError

_UNREAD = 8  # octets, 400 ms of orders: a drive that reads later would obey old ones


class DriveFile:
    """A file that gets `1` or `0` and never blocks.

    It stays open, for an Arduino starts again whenever its line is opened. What is replaced is opened again.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._file: int | None = None

    def write(self, on: bool) -> None:
        """Write an order. Raises UserError, with the reason, if the drive cannot get it."""
        try:
            self._write(self._opened(), f"{on:d}\n".encode())
        except OSError as error:
            self._close()
            reason = "nobody reads it" if error.errno in (errno.ENXIO, errno.EPIPE) else error.strerror
            raise UserError(f"file: {self._path} cannot be written: {reason}") from None

    def leave(self) -> None:
        """Turn the drive off for the last time. If that fails, health has reported it before."""
        with suppress(UserError):
            self.write(False)

    def _opened(self) -> int:
        if self._file is not None and not os.path.samestat(os.stat(self._path), os.fstat(self._file)):
            self._close()
        if self._file is None:
            self._file = os.open(self._path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        return self._file

    def _close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

    @staticmethod
    def _write(file: int, order: bytes) -> None:
        mode = os.fstat(file).st_mode
        if stat.S_ISREG(mode):
            os.pwrite(file, order, 0)
        elif not stat.S_ISFIFO(mode) and not stat.S_ISCHR(mode):
            raise OSError(errno.EINVAL, "it is no file, serial line or pipe")
        elif _unread(file, mode) > _UNREAD - len(order) or os.write(file, order) < len(order):
            raise OSError(errno.EAGAIN, "its reader does not read")


def _unread(file: int, mode: int) -> int:
    """Return how many octets wait in a pipe or a serial line."""
    if not stat.S_ISFIFO(mode) and not os.isatty(file):
        return 0
    request = termios.FIONREAD if stat.S_ISFIFO(mode) else termios.TIOCOUTQ
    return int.from_bytes(fcntl.ioctl(file, request, bytes(4)), "little")
