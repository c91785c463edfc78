"""The sentinel's policy: from observations to actions, without clock, process or network."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from deploy.supervision import manifest, processes
from deploy.supervision.supervisord import Program
from interfaces.service.health import PERIOD

RECENT = 60.0  # s for which a restart counts as recent


@dataclass(frozen=True)
class Observation:
    """The state of all processes at one time."""

    time: float
    """[s, monotonic clock]"""
    programs: list[Program]
    last_health: Mapping[tuple[str, int], float] = field(default_factory=dict)
    """time of the last health report of a process, by program and pid [s, monotonic clock]"""
    stopped: frozenset[int] = frozenset()
    """pids of supervised processes that are stopped (SIGSTOP)"""
    duplicates: frozenset[processes.Process] = frozenset()
    """live processes of programs that supervisord has not started"""

    @property
    def is_complete(self) -> bool:
        """Whether every program has a process that has reported its health."""
        return all((program.name, program.pid) in self.last_health for program in self.programs)


class Action(NamedTuple):
    """An action on a program, with its reason."""

    verb: str
    """kill or revive"""
    program: str
    pid: int
    reason: str


@dataclass(frozen=True)
class Timeouts:
    """The times of the policy [s]."""

    period: float = 0.5
    """between two observations"""
    health: float = 2.7
    """without a report of health of a service, which makes one each second"""
    start: float = 10.0
    """of a new process until its first health"""
    duplicate: float = 1.0
    """of a duplicate, which has to end itself"""
    first_revival: float = 1.0
    """before the first revival; twice as long before each further one"""
    longest_revival: float = 60.0


class Policy:
    def __init__(self, timeouts: Timeouts | None = None) -> None:
        self.kill_inhibited_by = ""
        """why silent services are not killed; '' if they are"""
        self.reasons: dict[str, str] = {}
        """the reason of the last action on each program"""
        self.recent_restarts: dict[str, int] = {}
        """restarts of each program within the last minute"""
        self.hears_itself = True
        """Whether the sentinel's own reports of health arrive; if not, it cannot judge others"""
        self._timeouts = timeouts or Timeouts()
        # Of each program: pid, time of its first observation, and how long its first health may take.
        self._first_seen: dict[str, tuple[int, float, float]] = {}
        self._deaf_since = math.inf
        # Processes that have been silent since most services were, and when that was last so.
        self._silent_with_most: dict[int, float] = {}
        self._stopped_since: dict[int, float] = {}
        self._duplicate_since: dict[int, float] = {}
        self._revivals: dict[str, tuple[float, float]] = {}  # delay of the next, and when it is due
        self._restarts: dict[str, list[tuple[float, int]]] = {}  # times and counts; the first is not recent
        self._last_time: float | None = None
        self._paused = 0.0  # [s] that the sentinel could not observe
        self._last_health: dict[
            tuple[str, int], tuple[float, float]
        ] = {}  # by the monotonic and the own clock

    def decide(self, observation: Observation) -> list[Action]:
        observation = self._in_own_time(observation)
        self._count_restarts(observation)
        running = [program for program in observation.programs if program.state in ("STARTING", "RUNNING")]
        actions = self._kill_stopped(observation, running)
        actions += self._kill_silent(observation, [p for p in running if p.pid not in observation.stopped])
        actions += self._kill_duplicates(observation)
        actions += self._revive(observation)
        for action in actions:
            self.reasons[action.program] = action.reason
        return actions

    def _in_own_time(self, observation: Observation) -> Observation:
        """Return the observation on a clock that stands still while the sentinel cannot observe.

        A paused or overloaded machine delays the services' reports as well: they are not silent.
        """
        if self._last_time is not None:
            self._paused += max(0.0, observation.time - self._last_time - self._timeouts.period)
        self._last_time = observation.time
        before, self._last_health = self._last_health, {}
        for process, when in observation.last_health.items():
            known = before.get(process)
            self._last_health[process] = known if known and known[0] == when else (when, when - self._paused)
        last_health = {process: when for process, (_, when) in self._last_health.items()}
        return replace(observation, time=observation.time - self._paused, last_health=last_health)

    def _count_restarts(self, observation: Observation) -> None:
        """Count: a program that dies again and again after running for a while never becomes FATAL."""
        for program in observation.programs:
            counts = self._restarts.setdefault(program.name, [(observation.time, program.restarts)])
            if program.restarts != counts[-1][1]:
                counts.append((observation.time, program.restarts))
            while len(counts) > 1 and observation.time - counts[1][0] >= RECENT:
                del counts[0]
            self.recent_restarts[program.name] = max(0, program.restarts - counts[0][1])

    def _kill_stopped(self, observation: Observation, running: list[Program]) -> list[Action]:
        """Kill stopped processes: the kernel reports them, so a failing network cannot mislead the policy."""
        now = observation.time
        since = {pid: self._stopped_since.get(pid, now) for pid in observation.stopped}
        self._stopped_since = since
        return [
            Action("kill", program.name, program.pid, f"stopped for {now - since[program.pid]:.1f} s")
            for program in running
            if program.pid in since and now - since[program.pid] >= self._timeouts.health
        ]

    def _kill_silent(self, observation: Observation, running: list[Program]) -> list[Action]:
        silent = []
        expected = 0  # services whose health is due
        late = 0  # those of them that are silent now, or will be within the period of reports
        for program in running:
            pid, since, start = self._first_seen.get(program.name, (0, 0.0, 0.0))
            if pid != program.pid:
                # A new sentinel subtracts the time that the process has had already.
                start = max(2 * self._timeouts.health, self._timeouts.start - program.uptime)
                pid, since = program.pid, observation.time
                self._first_seen[program.name] = (pid, since, start)
            reported = observation.last_health.get((program.name, pid))
            silence = observation.time - (since if reported is None else reported)
            timeout = start if reported is None else self._timeouts.health
            is_expected = reported is not None or silence >= start
            expected += is_expected
            late += is_expected and silence >= timeout - PERIOD
            if silence >= timeout:
                silent.append(Action("kill", program.name, pid, f"no health for {silence:.1f} s"))
        self.kill_inhibited_by = ""
        itself = [action for action in silent if action.program == manifest.sentinel()]
        self.hears_itself = not itself
        if itself:
            self.kill_inhibited_by = "the sentinel does not hear itself"
            self._deaf_since = min(self._deaf_since, observation.time)
            # A deaf sentinel is useless; its successor may hear.
            return itself if observation.time - self._deaf_since >= self._timeouts.start else []
        self._deaf_since = math.inf
        most = bool(silent) and late > 1 and 2 * late > expected
        if most:
            self.kill_inhibited_by = f"{late} of {expected} services are silent at once"
        # After a failure of the network, processes have to discover each other again, as new ones do.
        known = self._silent_with_most
        last = {it.pid: observation.time if most else known.get(it.pid, -math.inf) for it in silent}
        self._silent_with_most = last
        return [it for it in silent if observation.time - last[it.pid] >= self._timeouts.start]

    def _kill_duplicates(self, observation: Observation) -> list[Action]:
        now = observation.time
        since = {
            process.pid: self._duplicate_since.get(process.pid, now) for process in observation.duplicates
        }
        self._duplicate_since = since
        return [
            Action("kill", duplicate.program, duplicate.pid, f"process {duplicate.pid} was a duplicate")
            for duplicate in sorted(observation.duplicates)
            if now - since[duplicate.pid] >= self._timeouts.duplicate
        ]

    def _revive(self, observation: Observation) -> list[Action]:
        actions = []
        for program in observation.programs:
            delay, due = self._revivals.get(program.name, (self._timeouts.first_revival, math.nan))
            if program.state == "RUNNING":
                self._revivals.pop(program.name, None)
            elif program.state != "FATAL":
                self._revivals[program.name] = (delay, math.nan)
            elif math.isnan(due):
                self._revivals[program.name] = (delay, observation.time + delay)
            elif observation.time >= due:
                longer = min(2 * delay, self._timeouts.longest_revival)
                self._revivals[program.name] = (longer, math.nan)
                actions.append(Action("revive", program.name, 0, f"FATAL; revived after {delay:g} s"))
        return actions
