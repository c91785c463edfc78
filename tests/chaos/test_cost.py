from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.supervision import processes
from deploy.supervision.system import System
from tests.chaos.arm import RealArm
from tests.chaos.cost import Cost
from tests.chaos.faults import FAULT_KINDS
from tests.promises.history import ALL

BUSY = 0.5  # s
ERROR = 0.1  # s of the kernel's count, of starting and of ending

SUPERVISORD = f"""
import os, signal, time
if os.fork() == 0:
    while time.process_time() < {BUSY}:
        pass
    os._exit(0)
os.wait()
print(sum(os.times()[:4]), flush=True)
signal.pause()
"""


class Supervised(RealArm):
    """An arm with a process that has waited for a busy child."""

    def __init__(self, run: Path) -> None:
        super().__init__("/", System(run))
        self.process = subprocess.Popen(
            [sys.executable, "-c", SUPERVISORD],
            env={processes.MARK: str(run)},
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.spent = float(self.process.stdout.readline())


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Supervised]:
    arm = Supervised(tmp_path)
    try:
        yield arm
    finally:
        arm.process.kill()
        arm.process.communicate()


def burn(seconds: float) -> None:
    """Use processor time of this process, which is no part of the arm."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_cost_counts_ended_children_but_no_other_process(arm: Supervised) -> None:
    burn(BUSY)
    assert arm.spent >= BUSY - ERROR
    assert Cost.now([arm]).busy == pytest.approx(arm.spent, abs=ERROR)
    assert Cost.now([arm]).processes == 1


def test_cost_of_a_killed_supervisord_is_not_lost(arm: Supervised) -> None:
    FAULT_KINDS["kill_supervisor"].inject(arm, ALL)
    arm.process.wait()
    assert arm.system.members() == []
    assert arm.processor_time() == pytest.approx(arm.spent, abs=ERROR)


def test_cost_is_shown_for_each_arm() -> None:
    before = Cost(time=10.0, busy=1.0, arms=2, processes=8, memory=200.0, threads=30)
    after = Cost(time=20.0, busy=5.0, arms=2, processes=8, memory=220.0, threads=34)
    assert after.since(before) == "0.20 cores, 110 MB (+10), 17 threads (+2) in 4 processes per arm"
