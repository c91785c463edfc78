"""A lock between commands, which ends with its process."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from deploy.supervision import interruption


@contextmanager
def held(directory: Path, work: str) -> Iterator[None]:
    """Hold a directory. Wait while another command holds it, and print for which work."""
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            with suppress(OSError):  # a closed terminal
                print(f"Waiting for another make to end its {work}.", flush=True)
            with interruption.blocking():
                fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
