"""Processes of another user of this machine; only root can start them."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

NOBODY = 65534

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="platform: only root can be another user")


def command_of_nobody(*command: str | Path) -> list[str]:
    """Return a command that another user runs."""
    user = f"{NOBODY}"
    return ["setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups", *map(str, command)]


@contextmanager
def process_of_nobody(*command: str | Path, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """Run a command of another user, with only these variables; it has printed a line."""
    path = {"PATH": os.environ["PATH"]}
    with subprocess.Popen(
        command_of_nobody(*command), env={**path, **environment}, stdout=subprocess.PIPE, text=True, cwd="/"
    ) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process
        finally:
            process.kill()


@contextmanager
def public_folder() -> Iterator[Path]:
    """Make a folder that all users can read; the one of pytest is closed to them."""
    with TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        yield Path(folder)


@contextmanager
def fork(task: Callable[[], object], *, user: int | None = None) -> Iterator[int]:
    """Do a task in a fork, perhaps as another user; it lives until the end of the ``with``."""
    reading, writing = os.pipe()
    if not (pid := os.fork()):
        try:
            if user is not None:
                os.setresuid(user, user, user)
            kept = task()
            os.write(writing, b"done")
            signal.pause()
            del kept
        finally:
            os._exit(1)
    os.close(writing)
    try:
        assert os.read(reading, 4) == b"done"
        yield pid
    finally:
        os.close(reading)
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
