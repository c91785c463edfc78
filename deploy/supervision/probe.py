"""Observes the processes of the sentinel's system."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping

from deploy.supervision import processes
from deploy.supervision.policy import Observation
from deploy.supervision.system import DeploymentError, Program, System
from interfaces.service.health import Health

DUPLICATES_PERIOD = 1.0  # s between two searches for duplicates, which read the whole process table


class Probe:
    """Observes the processes of a system; part of a process that supervisord has started."""

    def __init__(self, system: System, supervisor: int) -> None:
        self._system = system
        self._supervisor = supervisor
        self._last_health: dict[tuple[str, int], float] = {}
        self._next_search = 0.0
        self._duplicates: frozenset[processes.Process] = frozenset()

    def hear(self, reports: Mapping[str, Health]) -> None:
        """Note health reports, by program."""
        for program, health in reports.items():
            self._last_health[program, health.pid] = health.heard

    def observe(self) -> Observation:
        """Return an observation. Raises DeploymentError where supervisord is gone or does not answer."""
        if os.getppid() != self._supervisor:
            raise DeploymentError("supervisord has died: a killed process would not be replaced")
        programs = self._system.watch(self._supervisor)
        now = time.monotonic()
        if now >= self._next_search:
            self._next_search = now + DUPLICATES_PERIOD
            self._duplicates = self._find_duplicates(programs)
        for gone in self._last_health.keys() - {(program.name, program.pid) for program in programs}:
            del self._last_health[gone]  # of dead processes and of other hosts
        stopped = frozenset(p.pid for p in programs if p.pid and _state_of(p.pid)[0] == "T")
        return Observation(now, programs, dict(self._last_health), stopped, self._duplicates)

    def _find_duplicates(self, programs: list[Program]) -> frozenset[processes.Process]:
        """The processes of a program that supervisord has not started and is not about to start."""
        supervised = {program.name: program.pid for program in programs}
        return frozenset(
            process
            for process in processes.of_system(self._system.run)
            if supervised.get(process.program, process.pid) != process.pid
            and _state_of(process.pid)[1] not in (0, self._supervisor, *supervised.values())
        )


def _state_of(pid: int) -> tuple[str, int]:
    """State and parent of a process; ('', 0) if it has ended."""
    stat = processes.stat_of(pid)
    return (stat[0], int(stat[1])) if stat else ("", 0)
