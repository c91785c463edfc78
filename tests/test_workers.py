from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import ROOT
from tests.workers import done


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_results_come_in_order(method: str) -> None:
    assert [*done(abs, [-3, 2, -1], bool, (), method=method)] == [3, 2, 1]


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_worker_that_is_killed_is_an_error(method: str) -> None:
    with pytest.raises(DeploymentError, match="A worker process was killed"):
        [*done(signal.raise_signal, [signal.SIGKILL, signal.SIGTERM], bool, (), method=method)]


def test_error_of_the_work_is_passed_on() -> None:
    with pytest.raises(ZeroDivisionError):
        [*done(divmod_by_zero, [1], bool, (), method="fork")]


def divmod_by_zero(number: int) -> None:
    divmod(number, 0)


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_workers_end_with_a_killed_parent(method: str) -> None:
    work = r"time.sleep, [1e6, 1e6], os.write, (1, b'begun\n')"
    code = f"import os, time; from tests.workers import done; [*done({work}, method={method!r})]"
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        assert [parent.stdout.readline() for _ in range(2)] == [b"begun\n"] * 2
        workers = children(parent.pid)
        parent.kill()
    deadline = time.monotonic() + 60.0
    while (left := [*filter(is_running, workers)]) and time.monotonic() < deadline:
        time.sleep(0.01)
    for worker in left:
        os.kill(worker, signal.SIGKILL)
    assert not left


def children(pid: int) -> Sequence[int]:
    """Return the children of a process, without the one that only tracks resources."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    commands = {int(each): Path(f"/proc/{each}/cmdline").read_bytes() for each in found}
    return [each for each, command in commands.items() if b"resource_tracker" not in command]


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
