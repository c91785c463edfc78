"""The sentinel's policy: from observations to actions, without clock, process or network."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from deploy.supervision import processes
from deploy.supervision.processes import Effort
from deploy.supervision.silence import Silence
from deploy.supervision.supervisord import Program

RECENT = 60.0  # s for which a restart counts as recent


@dataclass(frozen=True)
class Observation:
    """The state of all processes at one time."""

    time: float
    """[s, monotonic clock]"""
    programs: list[Program]
    last_beat: Mapping[int, float] = field(default_factory=dict)
    """time of the last sign of life of a process, by pid [s, monotonic clock]"""
    last_health: Mapping[tuple[str, int], float] = field(default_factory=dict)
    """time of the last health report of a process, by program and pid [s, monotonic clock]"""
    efforts: Mapping[int, Effort] = field(default_factory=dict)
    """processor times, by pid"""
    flood: str = ""
    """why reports may be lost or late; '' if they are not"""
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
    """without a sign of life of a service, which gives one each second"""
    start: float = 10.0
    """of a new process until its first sign of life, and of any without a report of health"""
    duplicate: float = 1.0
    """of a duplicate, which has to end itself"""
    first_revival: float = 1.0
    """before the first revival; twice as long before each further one"""
    longest_revival: float = 60.0


class Policy:
    def __init__(self, timeouts: Timeouts | None = None) -> None:
        self.kill_inhibited_by = ""
        """why silent services are not killed; '' if they are"""
        self.delayed: list[str] = []
        """services that are late because the machine or a flood keeps them from running"""
        self.reasons: dict[str, str] = {}
        """the reason of the last action on each program"""
        self.recent_restarts: dict[str, int] = {}
        """restarts of each program within the last minute"""
        self._timeouts = timeouts or Timeouts()
        self._beats = Silence(self._timeouts.health, self._timeouts.start)
        self._reports = Silence(self._timeouts.start, self._timeouts.start)
        self._efforts: Mapping[int, Effort] = {}
        self._stopped_since: dict[int, float] = {}
        self._duplicate_since: dict[int, float] = {}
        self._revivals: dict[str, tuple[float, float]] = {}  # delay of the next, and when it is due
        self._restarts: dict[str, list[tuple[float, int]]] = {}  # times and counts; the first is not recent
        self._last_time: float | None = None
        self._paused = 0.0  # [s] that the sentinel could not observe

    @property
    def hears_itself(self) -> bool:
        """Whether the sentinel's own reports of health arrive, as far as it can know."""
        return self._reports.hears_itself

    def decide(self, observation: Observation) -> list[Action]:
        step = observation.time - (observation.time if self._last_time is None else self._last_time)
        self._last_time = observation.time
        # A paused or overloaded machine delays the services as well: this clock stands still meanwhile.
        pause = max(0.0, step - self._timeouts.period)
        self._paused += pause
        now = observation.time - self._paused
        self._count_restarts(observation, now)
        running = [program for program in observation.programs if program.state in ("STARTING", "RUNNING")]
        actions = self._kill_stopped(observation, now, running)
        actions += self._kill_silent(
            observation, step, pause, [p for p in running if p.pid not in observation.stopped]
        )
        actions += self._kill_duplicates(observation, now)
        actions += self._revive(observation, now)
        for action in actions:
            self.reasons[action.program] = action.reason
        return actions

    def _count_restarts(self, observation: Observation, now: float) -> None:
        """Count: a program that dies again and again after running for a while never becomes FATAL."""
        for program in observation.programs:
            counts = self._restarts.setdefault(program.name, [(now, program.restarts)])
            if program.restarts != counts[-1][1]:
                counts.append((now, program.restarts))
            while len(counts) > 1 and now - counts[1][0] >= RECENT:
                del counts[0]
            self.recent_restarts[program.name] = max(0, program.restarts - counts[0][1])

    def _kill_stopped(self, observation: Observation, now: float, running: list[Program]) -> list[Action]:
        """Kill stopped processes: the kernel reports them, so a failing network cannot mislead the policy."""
        since = {pid: self._stopped_since.get(pid, now) for pid in observation.stopped}
        self._stopped_since = since
        return [
            Action("kill", program.name, program.pid, f"stopped for {now - since[program.pid]:.1f} s")
            for program in running
            if program.pid in since and now - since[program.pid] >= self._timeouts.health
        ]

    def _kill_silent(
        self, observation: Observation, step: float, pause: float, running: list[Program]
    ) -> list[Action]:
        """Kill processes whose loop does not turn, and those that others do not hear, later."""
        passed = {
            each.pid: max(0.0, step - max(pause, self._held_up(each.pid, step, observation)))
            for each in running
        }
        self._efforts = observation.efforts
        silent = self._beats.judge(running, observation.last_beat, observation.time, passed)
        heard = {pid: when for (_, pid), when in observation.last_health.items()}
        mute = self._reports.judge(running, heard, observation.time, passed, observation.flood)
        self.kill_inhibited_by = self._beats.inhibited_by or self._reports.inhibited_by
        self.delayed = [program.name for program in self._beats.delayed]
        reasons = {each.program: f"no report of health for {each.seconds:.1f} s" for each in mute}
        reasons |= {each.program: f"no sign of life for {each.seconds:.1f} s" for each in silent}
        return [Action("kill", each.name, each.pid, reasons[each]) for each in running if each in reasons]

    def _held_up(self, pid: int, step: float, observation: Observation) -> float:
        """Return for how long the machine or a flood kept a loop from running since the last observation [s].

        A loop that got as much of the processor as it waited for counts as free: an endless loop is found on
        a busy machine as well. In a flood, the threads of DDS hold the locks that the loop waits for.
        """
        before, after = self._efforts.get(pid), observation.efforts.get(pid)
        if before is None or after is None:
            return 0.0
        ran, waited = after.loop - before.loop, after.waited - before.waited
        blocked = max(0.0, step - ran - waited)
        by_threads = min(after.others - before.others, blocked) if observation.flood else 0.0
        return max(0.0, waited - ran) + max(0.0, by_threads)

    def _kill_duplicates(self, observation: Observation, now: float) -> list[Action]:
        since = {
            process.pid: self._duplicate_since.get(process.pid, now) for process in observation.duplicates
        }
        self._duplicate_since = since
        return [
            Action("kill", duplicate.program, duplicate.pid, f"process {duplicate.pid} was a duplicate")
            for duplicate in sorted(observation.duplicates)
            if now - since[duplicate.pid] >= self._timeouts.duplicate
        ]

    def _revive(self, observation: Observation, now: float) -> list[Action]:
        actions = []
        for program in observation.programs:
            delay, due = self._revivals.get(program.name, (self._timeouts.first_revival, math.nan))
            if program.state == "RUNNING":
                self._revivals.pop(program.name, None)
            elif program.state != "FATAL":
                self._revivals[program.name] = (delay, math.nan)
            elif math.isnan(due):
                self._revivals[program.name] = (delay, now + delay)
            elif now >= due:
                longer = min(2 * delay, self._timeouts.longest_revival)
                self._revivals[program.name] = (longer, math.nan)
                actions.append(Action("revive", program.name, 0, f"FATAL; revived after {delay:g} s"))
        return actions
