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
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path

from tests.mutants.guards import REACTIVE_NODE
from tests.mutants.mutations import Mutant
from tests.runtimes import needs_virtual_time

MARK = "REACTIVE_ARM_MUTANTS"
"""An environment variable that all processes of a copy inherit."""
# A mutant may take this multiple of the original's time, and some seconds more.
_PATIENCE, _ALLOWANCE = 5, 10.0


class CheckoutCopy:
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
        # Before the copy of the checkout: a folder of PYTHONPATH that has this file stays before .venv.
        source = self._directory / REACTIVE_NODE.removesuffix("/reactive_node")
        source.mkdir(parents=True, exist_ok=True)
        (source / "sitecustomize.py").touch()
        path = [str(source)]
        path += [folder for folder in [os.environ.get("PYTHONPATH")] if folder]
        self._environment = os.environ | {MARK: self._mark, "PYTHONPATH": os.pathsep.join(path)}
        self._runners: dict[bool, subprocess.Popen[str]] = {}

    def _runner(self, *, in_virtual_time: bool) -> subprocess.Popen[str]:
        """Return the process that runs tests on ROS 2's rclpy, or in virtual time; start it once."""
        runner = self._runners.get(in_virtual_time)
        if runner is None:
            first = ["rclpy_simulation"] if in_virtual_time else []
            runner = self._runners[in_virtual_time] = subprocess.Popen(
                [sys.executable, str(self._directory / "tests/mutants/runner.py"), *first],
                cwd=self._directory,
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                start_new_session=True,  # Ctrl-C ends it by close()
            )
            _answer(runner)
        return runner

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
        runner = self._runner(in_virtual_time=needs_virtual_time(tests))
        assert runner.stdin is not None
        print(json.dumps([*options, *tests]), file=runner.stdin, flush=True)
        child = int(_answer(runner))
        timer = threading.Timer(timeout, os.killpg, (child, signal.SIGKILL))
        timer.start()
        try:
            return int(_answer(runner))
        finally:
            timer.cancel()
            self._end_processes(but=[each.pid for each in self._runners.values()])

    def _end_processes(self, but: Collection[int] = ()) -> None:
        mark = f"{MARK}={self._mark}".encode()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) not in but:
                with suppress(OSError):
                    if mark in (entry / "environ").read_bytes().split(b"\0"):
                        os.kill(int(entry.name), signal.SIGKILL)

    def close(self) -> None:
        """End all processes; a test that runs on another thread fails."""
        self._end_processes()
        for runner in self._runners.values():
            runner.communicate()


def _answer(runner: subprocess.Popen[str]) -> str:
    assert runner.stdout is not None
    line = runner.stdout.readline()
    if not line:
        raise RuntimeError("the runner of the tests has ended")
    return line
