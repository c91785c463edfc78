"""What keeps a start or a stop waiting."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.system.sites import Command, Site


@contextmanager
def another_at_work(site: Site) -> Iterator[None]:
    logs = site.run / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    directory = os.open(logs, os.O_RDONLY)
    try:
        fcntl.flock(directory, fcntl.LOCK_EX)
        yield
    finally:
        os.close(directory)


@contextmanager
def writer_to_a_reader_of(fifo: Path, command: Command) -> Iterator[int]:
    """A writer that writes nothing to a fifo that a command reads."""
    writer = None
    while writer is None:
        assert command.is_alive, command.output
        time.sleep(0.01)
        with suppress(OSError):  # no reader yet
            writer = os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
    try:
        yield writer
    finally:
        os.close(writer)
