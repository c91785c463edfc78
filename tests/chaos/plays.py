"""Plays of the monkey in processes of their own, judged when they are over."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from deploy import processes
from deploy.chaos import record
from deploy.chaos.findings import Finding
from deploy.chaos.history import History
from deploy.chaos.promises import CHECKERS

LONGEST = 150.0  # s


class Play:
    """A play that is over."""

    def __init__(self, directory: Path, output: str, code: int) -> None:
        self.output = output
        self.code = code
        self.page = next(directory.glob("chaos/*/report.html"))
        self.history: History = record.load(self.page.with_name("record.mcap"))
        self.findings: dict[str, Finding] = {name: check(self.history) for name, check in CHECKERS.items()}

    def finding(self, promise: str) -> Finding:
        """The finding on a promise, which is not broken."""
        finding = self.findings[promise]
        assert not finding.evidence, f"{promise}: {finding.evidence}"
        return finding


def play(scenario: str, run: Path) -> Play:
    """Play a named scenario, with a directory for its runtime files."""
    process = subprocess.Popen(
        [sys.executable, "-m", "deploy.chaos", "--scenario", scenario],
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
    return Play(run, output, process.returncode)
