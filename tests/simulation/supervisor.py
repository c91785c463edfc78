"""supervisord as the programs of an arm experience it, in virtual time.

The rules are those of supervisor 4.3 with the settings of deploy/supervisord.conf and the extension of
deploy/supervision: a program is started again as soon as it has ended; after an early end the pause grows by
a second each time; a sentinel that stops asking is killed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy_simulation import Process, Simulation

from deploy.supervision import manifest
from deploy.supervision.extension import LONGEST_WAIT, SENTINEL_START_TIMEOUT, SENTINEL_TIMEOUT
from deploy.supervision.manifest import SENTINEL
from deploy.supervision.supervisord import Program

START_SECONDS = 1.0  # s; supervisor's default of startsecs


@dataclass
class _Supervised:
    name: str
    state: str = "STOPPED"
    process: Process | None = None
    started: float = 0.0
    starts: int = 0
    early_ends: int = 0
    exit: str = ""
    error: str = ""
    ended: float | None = None
    away: float = 0.0


class Supervisor:
    def __init__(self, simulation: Simulation, programs: list[str], spawn: Callable[[str, int], Process]):
        """:param spawn: starts a process of a program, given its name and the pid of its parent."""
        self._simulation = simulation
        self._spawn = spawn
        self.pid = simulation.next_pid()
        self.is_alive = True
        self._programs = {name: _Supervised(name) for name in programs}
        self._asked = simulation.now + SENTINEL_START_TIMEOUT
        for each in self._programs.values():
            self._start(each)
        self._guard()

    # What the sentinel asks for

    def watch(self) -> list[Program]:
        """Return the programs; the call is the sentinel's sign of life."""
        self._asked = self._simulation.now + SENTINEL_TIMEOUT
        return self.programs()

    def programs(self) -> list[Program]:
        now = self._simulation.now
        return [
            Program(
                each.name,
                each.state,
                each.process.pid if each.process else 0,
                now - each.started if each.process else 0.0,
                max(0, each.starts - 1),
                each.exit,
                each.error,
                each.away,
            )
            for each in self._programs.values()
        ]

    def revive(self, name: str) -> None:
        each = self._programs[name]
        if each.state == "FATAL":
            each.early_ends = 0
            self._start(each)

    def process(self, name: str) -> Process | None:
        return self._programs[name].process

    def die(self) -> None:
        """End: the processes live on as orphans."""
        self.is_alive = False
        for each in self._programs.values():
            if each.process is not None:
                each.process.parent_pid = 1

    # The life of a program

    def _start(self, each: _Supervised) -> None:
        if not self.is_alive:
            return
        each.state, each.error = "STARTING", ""
        each.started = self._simulation.now
        each.away = each.started - (each.started if each.ended is None else each.ended)
        each.starts += 1
        process = each.process = self._spawn(each.name, self.pid)
        process.at_end(lambda: self._note_end(each, process))
        self._simulation.after(START_SECONDS, lambda: self._note_running(each, process))

    def _note_running(self, each: _Supervised, process: Process) -> None:
        if each.process is process and each.state == "STARTING":
            each.state, each.early_ends = "RUNNING", 0

    def _note_end(self, each: _Supervised, process: Process) -> None:
        if not self.is_alive or each.process is not process:
            return
        each.process = None
        each.ended = self._simulation.now
        if each.state == "RUNNING":
            code = process.exit_code or 0
            each.state = "EXITED"
            each.exit = "killed by a signal" if code < 0 else f"code {code}"
            pause = 0.0
        else:
            each.early_ends += 1
            each.exit = "early"
            each.error = "Exited too quickly (process log may have details)"
            each.state = "BACKOFF" if each.early_ends <= manifest.start_retries(each.name) else "FATAL"
            pause = float(each.early_ends)
        if each.state != "FATAL":
            # It notices an end at once, and acts on time with its next poll.
            late = self._simulation.random.uniform(0.0, LONGEST_WAIT) if pause else 0.0
            self._simulation.after(pause + late, lambda: self._start(each))

    def _guard(self) -> None:
        if not self.is_alive:
            return
        sentinel = self._programs.get(SENTINEL)
        if sentinel is not None and sentinel.process is not None:
            began = sentinel.started + SENTINEL_START_TIMEOUT
            asked = self._asked if self._asked > sentinel.started + SENTINEL_TIMEOUT else began
            if self._simulation.now > asked:
                sentinel.process.kill()
        self._simulation.after(LONGEST_WAIT, self._guard)
