"""The lines of `make logs`."""

from __future__ import annotations

import os
import re
import select
import subprocess
from collections.abc import Generator
from datetime import datetime
from pathlib import Path

LATEST = 10  # lines of each file
WAIT = 0.1  # s
CHUNK = 65536  # bytes
_STAMP = re.compile(rb"\[(\d+)\.(\d{3})\d*\]")


def follow(run: Path, files: list[str]) -> Generator[bytes | None, None, None]:
    """Emit the lines that are written to files of a run directory; ``None`` after each ``WAIT`` without."""
    command = ["tail", "-n", str(LATEST), "-F", *files]
    with subprocess.Popen(command, cwd=run, stdout=subprocess.PIPE) as tail:
        assert tail.stdout is not None
        rest = b""
        try:
            while tail.poll() is None:
                if select.select([tail.stdout], [], [], WAIT)[0]:
                    *lines, rest = (rest + os.read(tail.stdout.fileno(), CHUNK)).split(b"\n")
                    yield from lines
                else:
                    yield None
        finally:
            tail.terminate()


def readable(line: bytes) -> bytes:
    """Return a line with its time as supervisord writes it, in local time, instead of seconds since 1970."""

    def local(stamp: re.Match[bytes]) -> bytes:
        return f"[{datetime.fromtimestamp(int(stamp[1]))},{stamp[2].decode()}]".encode()

    return _STAMP.sub(local, line, count=1)
