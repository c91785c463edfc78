"""Plays of the monkey in processes of their own, judged when they are over."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from deploy.chaos import record
from deploy.chaos.findings import Finding
from deploy.chaos.history import History, suffix
from deploy.chaos.promises import CHECKERS
from deploy.supervision import processes

LONGEST = 150.0  # s


class Play:
    """What became of an arm in a play that is over."""

    def __init__(self, directory: Path, output: str, code: int, namespace: str = "/") -> None:
        self.output = output
        self.code = code
        self.page = next(directory.glob(f"chaos/*/report{suffix(namespace)}.html"))
        self.history: History = record.load(self.page.with_name("record.mcap"), namespace)
        self.findings: dict[str, Finding] = {name: check(self.history) for name, check in CHECKERS.items()}

    def finding(self, promise: str) -> Finding:
        """The finding on a promise, which is not broken."""
        finding = self.findings[promise]
        assert not finding.evidence, f"{promise}: {finding.evidence}"
        return finding


def play(run: Path, *options: str) -> Play:
    """Play with one arm and a directory for its runtime files."""
    return Play(run, *unleash(run, *options))


def unleash(run: Path, *options: str) -> tuple[str, int]:
    """Let the monkey play; what it said, and its exit code."""
    process = subprocess.Popen(
        [sys.executable, "-m", "deploy.chaos", *options],
        cwd=processes.ROOT,
        env={**os.environ, "REACTIVE_ARM_RUN_DIR": str(run)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        output = process.communicate(timeout=LONGEST)[0]
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(timeout=20.0)
    assert "Report: " in output, output
    return output, process.returncode
