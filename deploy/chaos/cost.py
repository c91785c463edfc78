"""What arms cost the machine: processor, memory, threads."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from deploy.chaos.arena import ArmUnderTest


@dataclass(frozen=True)
class Cost:
    """What has been spent up to a moment."""

    time: float
    """[s, monotonic clock]"""
    busy: float
    """[s] of processor time of the whole machine: the killed processes' is in it, and everybody else's"""
    arms: int
    processes: int
    memory: float
    """[MB], resident"""
    threads: int

    @classmethod
    def now(cls, arms: Sequence[ArmUnderTest]) -> Cost:
        """The cost of the arms now."""
        processes = threads = 0
        memory = 0.0
        for arm in arms:
            for member in arm.system.members():
                with suppress(OSError, KeyError):
                    lines = Path(f"/proc/{member.pid}/status").read_text().splitlines()
                    fields = dict(line.split(":", 1) for line in lines)
                    memory += int(fields["VmRSS"].split()[0]) / 1024
                    threads += int(fields["Threads"])
                    processes += 1
        ticks = map(int, Path("/proc/stat").read_text().split()[1:4])
        busy = sum(ticks) / os.sysconf("SC_CLK_TCK")
        return cls(time.monotonic(), busy, len(arms), processes, memory, threads)

    def since(self, before: Cost) -> str:
        """In words, for each arm; in brackets what memory and threads have grown by."""
        cores = (self.busy - before.busy) / (self.time - before.time) / self.arms
        memory, threads = self.memory / self.arms, self.threads / self.arms
        return (
            f"{cores:.2f} cores (with observer and monkey), "
            f"{memory:.0f} MB ({memory - before.memory / self.arms:+.0f}), "
            f"{threads:.0f} threads ({threads - before.threads / self.arms:+.0f}) "
            f"in {self.processes / self.arms:.0f} processes an arm"
        )
