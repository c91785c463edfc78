"""An arm under test: its system, and where the faults find its processes."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from deploy.supervision import processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.system import System
from tests.chaos.clock import Clock
from tests.chaos.nested_faults import NestedFaults
from tests.promises.marks import BABBLER

PID_TIMEOUT = 2.0  # s to wait for a program that is being restarted


class RealArm:
    def __init__(self, namespace: str, system: System) -> None:
        self.namespace = namespace
        self.system = system
        self.domain = 0  # ROS_DOMAIN_ID
        self.parameters: Mapping[str, Any] = {}
        """The content of the user's parameter file."""
        self.nested = NestedFaults()
        self.clock = Clock(system.run.parent / f"clock{file_suffix(namespace)}")
        self._environment: dict[str, str] = {}
        self._spent = 0.0  # s of processor time of processes for whose end no supervisord waits

    def pid(self, program: str) -> int:
        """Return the process of a program, or 0. Waits for a program that is being restarted."""
        deadline = time.monotonic() + PID_TIMEOUT
        while True:
            with suppress(DeploymentError):
                for each in self.system.programs():
                    if each.name == program and each.state == "RUNNING":
                        return each.pid
            if time.monotonic() > deadline:
                # supervisord may be dead; its programs live on.
                return next((p.pid for p in self.system.members() if p.program == program), 0)
            time.sleep(0.02)

    def environment(self) -> dict[str, str]:
        """Return the environment of the arm's processes; the last known one if none is alive."""
        self._environment = self.system.environment() or self._environment
        return self._environment

    def processor_time(self) -> float:
        """Return the processor time [s] of the arm's processes, ended ones included."""
        pids = [member.pid for member in self.system.members() if member.program != BABBLER]
        return self._spent + sum(map(_processor_time, pids))

    def remember_processor_time(self, pids: Iterable[int]) -> None:
        """Count the processor time of processes on, which end without a supervisord that waits for them."""
        self._spent += sum(map(_processor_time, pids))


def _processor_time(pid: int) -> float:
    """Return the processor time [s] of a process, and of its children that it has waited for."""
    user, system, children_user, children_system = 11, 12, 13, 14  # after the name, see proc(5)
    fields = processes.stat_of(pid)
    ticks = (int(fields[at]) for at in (user, system, children_user, children_system) if fields)
    return sum(ticks) / os.sysconf("SC_CLK_TCK")


def file_suffix(namespace: str) -> str:
    """Return the end of an arm's file names: empty in the root namespace, ``_arm1`` in ``/arm1``."""
    return namespace.replace("/", "_").rstrip("_")
