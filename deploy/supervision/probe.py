"""Observes the processes of the sentinel's system."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from deploy.supervision import processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.policy import Observation
from deploy.supervision.supervisord import Program, Supervisord
from interfaces.seam import replaceable
from interfaces.service.beats import Beats
from interfaces.service.health import Health

ASKING_PERIOD = 1.0  # s between two questions to supervisord; each costs both of us a millisecond
DUPLICATES_PERIOD = 1.0  # s between two searches for duplicates, which read the whole process table
SEARCHING = 1000  # on a machine with many processes, so many times as long as a search takes
LONGEST_PERIOD = 10.0  # s


class Probe:
    """Observes the processes of a system; part of a process that supervisord has started."""

    def __init__(self, run: Path, supervisord: Supervisord) -> None:
        """:raises UserError: if the run directory can hold no named pipe."""
        self._run = run
        self._beats = Beats(run)
        self._last_beat: dict[int, float] = {}
        self._supervisord = supervisord
        self._programs: list[Program] = []
        self._next_question = 0.0
        self._last_health: dict[tuple[str, int], float] = {}
        self._next_search = 0.0
        self._duplicates: frozenset[processes.Process] = frozenset()

    def hear(self, reports: Mapping[str, Health]) -> None:
        for program, health in reports.items():
            if is_here(health.host):
                self._last_health[program, health.pid] = health.heard

    def observe(self) -> Observation:
        """Return an observation. Raises DeploymentError where supervisord is gone or does not answer.

        While all its processes live, supervisord is asked only now and then.
        """
        if os.getppid() != self._supervisord.pid:
            raise DeploymentError("supervisord has died: a killed process would not be replaced")
        stats = self._stats()
        if time.monotonic() >= self._next_question or not all(map(self._runs, self._programs, stats)):
            self._programs = self._supervisord.watch()
            self._next_question = time.monotonic() + ASKING_PERIOD
            stats = self._stats()
        now = time.monotonic()
        if now >= self._next_search:
            self._duplicates = self._find_duplicates()
            period = 0.0 if self._duplicates else SEARCHING * (time.monotonic() - now)
            self._next_search = now + min(max(period, DUPLICATES_PERIOD), LONGEST_PERIOD)
        for gone in self._last_health.keys() - {(program.name, program.pid) for program in self._programs}:
            del self._last_health[gone]  # of dead processes and of other hosts
        beats = self._last_beat | self._beats.take()
        self._last_beat = {each.pid: beats[each.pid] for each in self._programs if each.pid in beats}
        by_pid = {each.pid: stat for each, stat in zip(self._programs, stats, strict=True)}
        efforts = {pid: processes.effort_of(pid, stat) for pid, stat in by_pid.items()}
        return Observation(
            now,
            self._programs,
            self._last_beat,
            dict(self._last_health),
            {pid: effort for pid, effort in efforts.items() if effort},
            stopped=frozenset(pid for pid, stat in by_pid.items() if _state_of(stat)[0] == "T"),
            duplicates=self._duplicates,
        )

    def _stats(self) -> list[list[str]]:
        return [processes.stat_of(program.pid) if program.pid else [] for program in self._programs]

    def _runs(self, program: Program, stat: Sequence[str]) -> bool:
        state, parent = _state_of(stat)
        return program.state == "RUNNING" and state != "Z" and parent == self._supervisord.pid

    def _find_duplicates(self) -> frozenset[processes.Process]:
        """The processes of a program that supervisord has not started and is not about to start."""
        supervised = {program.name: program.pid for program in self._programs}
        parents = (0, self._supervisord.pid, *supervised.values())
        return frozenset(
            process
            for process in processes.of_system(self._run)
            if supervised.get(process.program, process.pid) != process.pid
            and _state_of(processes.stat_of(process.pid))[1] not in parents
        )


@replaceable
def is_here(host: str) -> bool:
    """Whether a report comes from this host: processes of two hosts may have the same pid."""
    return host == socket.gethostname()


def _state_of(stat: Sequence[str]) -> tuple[str, int]:
    """State and parent of a process; ('', 0) if it has ended."""
    return (stat[0], int(stat[1])) if stat else ("", 0)
