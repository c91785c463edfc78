"""A copy of the checkout in which mutants are tested."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from tests.mutants.guards import REACTIVE_NODE
from tests.mutants.mutations import Mutant

MARK = "REACTIVE_ARM_MUTANTS"
"""An environment variable that all processes of a bench inherit."""
# A mutant may take this multiple of the original's time, and some seconds more.
_PATIENCE, _ALLOWANCE = 5, 10.0


class Bench:
    """Tests mutants in a copy of the checkout: the checkout itself never changes. Used by one thread."""

    def __init__(self, root: Path, directory: Path) -> None:
        """Copy the files of a checkout that git knows or would add into a directory."""
        self._directory = directory
        self._mark = str(uuid.uuid4())
        self._changes = 0
        self._durations: dict[Sequence[str], float] = {}
        listing = ["git", "-C", str(root), "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
        for name in subprocess.run(listing, check=True, capture_output=True, text=True).stdout.split("\0"):
            if name and (root / name).is_file():
                (self._directory / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(root / name, self._directory / name)
        (self._directory / ".venv").symlink_to(root / ".venv")
        # Before the installed copy of reactive_node:
        path = [str(self._directory / REACTIVE_NODE.removesuffix("/reactive_node"))]
        path += [folder for folder in [os.environ.get("PYTHONPATH")] if folder]
        self._runner = subprocess.Popen(
            [sys.executable, str(self._directory / "tests/mutants/runner.py")],
            cwd=self._directory,
            env=os.environ | {MARK: self._mark, "PYTHONPATH": os.pathsep.join(path)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C ends it by close()
        )
        self._answer()

    def kills(self, mutant: Mutant, tests: Sequence[str]) -> bool:
        """Return whether tests fail or hang with a mutant. Raises RuntimeError if they fail without it."""
        if tests not in self._durations:
            began = time.monotonic()
            if self._test(tests, 1800.0) != 0:
                output = (self._directory / "output").read_text(errors="replace")
                raise RuntimeError(f"The tests fail without a mutant: {' '.join(tests)}\n{output[-3000:]}")
            self._durations[tests] = time.monotonic() - began
        path = self._directory / mutant.module
        original = path.read_bytes()
        self._write(path, mutant.code.encode())
        try:
            return self._test(tests, _PATIENCE * self._durations[tests] + _ALLOWANCE) != 0
        finally:
            self._write(path, original)

    def _write(self, path: Path, content: bytes) -> None:
        """Change a file; no two versions have a time in common, so Python compiles each of them."""
        path.write_bytes(content)
        self._changes += 1
        os.utime(path, (self._changes, self._changes))

    def _test(self, tests: Sequence[str], timeout: float) -> int:
        """Return the exit code of pytest; that of a kill after `timeout` [s]."""
        # The test that killed the mutant before comes first: it often kills the next one, too.
        options = ["-x", "-q", "--failed-first", "--hypothesis-profile=mutants"]
        assert self._runner.stdin is not None
        print(json.dumps([*options, *tests]), file=self._runner.stdin, flush=True)
        child = int(self._answer())
        timer = threading.Timer(timeout, os.killpg, (child, signal.SIGKILL))
        timer.start()
        try:
            return int(self._answer())
        finally:
            timer.cancel()
            self._end_processes(but=self._runner.pid)

    def _answer(self) -> str:
        assert self._runner.stdout is not None
        line = self._runner.stdout.readline()
        if not line:
            raise RuntimeError("the runner of the tests has ended")
        return line

    def _end_processes(self, but: int = 0) -> None:
        mark = f"{MARK}={self._mark}".encode()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != but:
                with suppress(OSError):
                    if mark in (entry / "environ").read_bytes().split(b"\0"):
                        os.kill(int(entry.name), signal.SIGKILL)

    def close(self) -> None:
        """End all processes; a test that runs on another thread fails."""
        self._end_processes()
        self._runner.communicate()
