"""Signs of life of the supervised processes of a host, through the kernel: no network delays or forges them.

Each process writes its pid and the time into a named pipe in the run directory, which only its user can do.
The kernel keeps some thousands of them until the sentinel reads.
"""

from __future__ import annotations

import os
import struct
import time
from contextlib import suppress
from pathlib import Path

from interfaces.arm_variables import SYSTEM
from interfaces.seam import replaceable
from interfaces.service.errors import UserError

_PIPE = "beats"
_RECORD = struct.Struct("<Qd")  # pid, time on the monotonic clock [s]
_CAPACITY = 65536  # octets that the kernel keeps in a pipe


@replaceable
def beat() -> None:
    """Show that this process lives, if it is supervised; never block."""
    if run := os.environ.get(SYSTEM):
        with suppress(OSError):  # no sentinel reads just now
            pipe = os.open(Path(run, _PIPE), os.O_WRONLY | os.O_NONBLOCK)
            try:
                os.write(pipe, _RECORD.pack(os.getpid(), time.monotonic()))
            finally:
                os.close(pipe)


class Beats:
    """The reader of the signs of life of a system."""

    @replaceable
    def __init__(self, run: Path) -> None:
        """:raises UserError: if the run directory can hold no named pipe."""
        pipe = run / _PIPE
        try:
            os.mkfifo(pipe, 0o600)
        except FileExistsError:
            pass  # of an earlier sentinel
        except OSError as error:
            raise UserError(
                f"{pipe}: {error.strerror}: REACTIVE_ARM_RUN_DIR must be on a file system with named pipes"
            ) from None
        self._pipe = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)  # with a writer of its own, it never ends

    @replaceable
    def take(self) -> dict[int, float]:
        """Return when processes have shown their life since the last call, by pid [s, monotonic clock]."""
        octets = b""
        with suppress(BlockingIOError):
            octets = os.read(self._pipe, _CAPACITY)
        whole = len(octets) - len(octets) % _RECORD.size
        return dict(_RECORD.iter_unpack(octets[:whole]))
