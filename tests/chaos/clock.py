"""The time of day of an arm's processes, by libfaketime.

libfaketime is preloaded into each process. Once a second, a process reads from a file by how much its time of
day is ahead of the machine's. So a step reaches the whole arm, and later processes, within a second.
The machine's own clock and monotonic time stay as they are.
"""

from __future__ import annotations

import os
import platform
import random
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LARGEST = 3600.0  # s; of a step
PACKAGE = "libfaketime"  # of Debian and Ubuntu
LIBRARY = Path(f"/usr/lib/{platform.machine()}-linux-gnu/faketime/libfaketimeMT.so.1")


def missing() -> str:
    """Return what this machine lacks for a step; empty if nothing."""
    return "" if LIBRARY.exists() else f"there is no {PACKAGE} (apt-get install {PACKAGE})"


class Clock:
    def __init__(self, path: Path) -> None:
        """:param path: of the file that the arm's processes read."""
        self.ahead = 0.0
        """Its lead over the machine's time of day [s]."""
        self._path = path
        self._random = random.Random(1)

    def environment(self) -> dict[str, str]:
        """Return the environment of the arm's processes, in addition to that of :func:`faked`."""
        return {"FAKETIME_TIMESTAMP_FILE": str(self._path)}

    def step(self) -> None:
        """Put the time of day forward or back, by at most an hour. The same steps in each run."""
        self.ahead = round(self.ahead + self._random.uniform(-LARGEST, LARGEST), 3)
        new = self._path.with_suffix(".new")
        new.write_text(f"{self.ahead:+.3f}\n")
        new.replace(self._path)


_HOLD = "import os, sys; print(os.environ['FAKETIME_SHARED'], flush=True); sys.stdin.read()"


@contextmanager
def faked() -> Iterator[dict[str, str]]:
    """Give the environment of processes whose time of day can be stepped until the end of the `with`."""
    environment = {
        "LD_PRELOAD": " ".join(filter(None, [str(LIBRARY), os.environ.get("LD_PRELOAD")])),
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "FAKETIME_CACHE_DURATION": "0",  # reads the file again when a second of the time of day begins
        "NO_FAKE_STAT": "1",  # otherwise, Python finds all modules changed and compiles them again
    }
    # Each process would create a semaphore, and leave it behind when it is killed, unless it inherits one.
    with subprocess.Popen(
        [sys.executable, "-c", _HOLD],
        env={**os.environ, **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C at the terminal must not end it: it removes the semaphore
    ) as holder:
        assert holder.stdout is not None
        yield environment | {"FAKETIME_SHARED": holder.stdout.readline().strip()}
