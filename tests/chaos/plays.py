"""Plays of the monkey in processes of their own, judged when they are over."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from deploy import processes
from deploy.chaos import record
from deploy.chaos.findings import Finding
from deploy.chaos.history import History
from deploy.chaos.promises import CHECKERS

LONGEST = 150.0  # s


class Play:
    """What became of an arm in a play that is over."""

    def __init__(self, directory: Path, output: str, code: int, namespace: str = "/") -> None:
        self.output = output
        self.code = code
        self.page = next(directory.glob(f"chaos/*/report{namespace.replace('/', '_').rstrip('_')}.html"))
        self.history: History = record.load(self.page.with_name("record.mcap"), namespace)
        self.findings: dict[str, Finding] = {name: check(self.history) for name, check in CHECKERS.items()}

    def finding(self, promise: str) -> Finding:
        """The finding on a promise, which is not broken."""
        finding = self.findings[promise]
        assert not finding.evidence, f"{promise}: {finding.evidence}"
        return finding


def play(run: Path, *options: str) -> Play:
    """Play with one arm and a directory for its runtime files."""
    with playing(run, *options) as end:
        return end()


@contextmanager
def playing(run: Path, *options: str) -> Iterator[Callable[..., Play]]:
    """Let the monkey play meanwhile; a function that waits for the end and gives an arm, by its namespace."""
    process = subprocess.Popen(
        [sys.executable, "-m", "deploy.chaos", *options],
        cwd=processes.ROOT,
        env={**os.environ, "REACTIVE_ARM_RUN_DIR": str(run)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    output = ""

    def end(namespace: str = "/") -> Play:
        nonlocal output
        output = output or process.communicate(timeout=LONGEST)[0]
        assert "Report: " in output, output
        return Play(run, output, process.returncode, namespace)

    try:
        yield end
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(timeout=20.0)
