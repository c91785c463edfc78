"""Runs of the chaos monkey in a subprocess, and their results."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from deploy.supervision import processes
from tests.chaos.arm import file_suffix
from tests.chaos.partition import missing
from tests.environment import user_environment
from tests.promises import observations
from tests.promises.findings import Finding
from tests.promises.history import History
from tests.promises.promises import checked

TIMEOUT = 150.0  # s


def need_two_hosts() -> None:
    """Skip a test where this machine cannot have hosts of its own."""
    if reason := missing():
        pytest.skip(f"platform: {reason}")


class ChaosRun:
    def __init__(self, directory: Path, output: str, code: int, namespace: str = "/") -> None:
        self.output = output
        self.code = code
        self.report = next(directory.glob(f"chaos/*/report{file_suffix(namespace)}.html"))
        self.history: History = observations.load(self.report.with_name("record.mcap"), namespace)
        self.findings: dict[str, Finding] = {each.promise: each for each in checked(self.history)}
        self.left_in_shared_memory: set[Path] = set()

    def finding(self, promise: str) -> Finding:
        """Return the finding on a promise, which must not be violated."""
        finding = self.findings[promise]
        assert not finding.evidence, f"{promise}: {finding.evidence}"
        return finding


def chaos_run(run: Path, *options: str) -> ChaosRun:
    before = fast_dds_files()
    result = ChaosRun(run, *unleash(run, *options))
    result.left_in_shared_memory = fast_dds_files() - before
    return result


def fast_dds_files() -> set[Path]:
    """Return the files of Fast DDS in shared memory; other tests do not have any."""
    return {*Path("/dev/shm").glob("fast*"), *Path("/dev/shm").glob("sem.fast*")}


def unleash(run: Path, *options: str) -> tuple[str, int]:
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.chaos", *options],
        cwd=processes.ROOT,
        env=user_environment() | {"REACTIVE_ARM_RUN_DIR": str(run)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        output = process.communicate(timeout=TIMEOUT)[0]
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(timeout=20.0)
    assert "Report: " in output, output
    return output, process.returncode
