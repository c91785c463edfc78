"""How much processor time, memory and threads the arms use."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tests.chaos.arm import RealArm
from tests.promises.marks import BABBLER


@dataclass(frozen=True)
class Cost:
    time: float
    """[s], monotonic clock."""
    busy: float
    """Processor time of the arms' processes [s], killed ones included."""
    arms: int
    processes: int
    memory: float
    """Proportional set size [MB]: the services share the memory of supervisord."""
    threads: int

    @classmethod
    def now(cls, arms: Sequence[RealArm]) -> Cost:
        processes = threads = 0
        memory = 0.0
        for arm in arms:
            for member in arm.system.members():
                if member.program == BABBLER:
                    continue
                with suppress(OSError, KeyError):
                    memory += proportional_set_size(member.pid)
                    threads += int(_field(member.pid, "status", "Threads"))
                    processes += 1
        busy = sum(arm.processor_time() for arm in arms)
        return cls(time.monotonic(), busy, len(arms), processes, memory, threads)

    def since(self, before: Cost) -> str:
        """Return the cost of an arm since an earlier moment; in brackets, how memory and threads grew."""
        cores = (self.busy - before.busy) / (self.time - before.time) / self.arms
        memory, threads = self.memory / self.arms, self.threads / self.arms
        return (
            f"{cores:.2f} cores, "
            f"{memory:.0f} MB ({memory - before.memory / self.arms:+.0f}), "
            f"{threads:.0f} threads ({threads - before.threads / self.arms:+.0f}) "
            f"in {self.processes / self.arms:.0f} processes per arm"
        )


def proportional_set_size(pid: int) -> float:
    """Return the memory of a process [MB]; of what it shares with others, its part."""
    return int(_field(pid, "smaps_rollup", "Pss")) / 1024


def _field(pid: int, file: str, name: str) -> str:
    lines = Path(f"/proc/{pid}/{file}").read_text().splitlines()
    return dict(line.split(":", 1) for line in lines if ":" in line)[name].split()[0]
