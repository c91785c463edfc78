"""What the sentinel decides: pure, from sight to sight; no clock, no process, no network."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from deploy.supervision import processes
from deploy.supervision.system import Watched

NAME = "sentinel"
MEMORY = 60.0  # s that a restart counts as a recent one


@dataclass(frozen=True)
class Sight:
    """All that the sentinel sees at one look."""

    time: float
    """[s, monotonic clock]"""
    programs: Iterable[Watched]
    heard: Mapping[tuple[str, int], float] = field(default_factory=dict)
    """when a program's process, by its pid, reported its health last [s, monotonic clock]"""
    stopped: frozenset[int] = frozenset()
    """pids of supervised processes that are stopped (SIGSTOP)"""
    doubles: frozenset[processes.Process] = frozenset()
    """live processes of programs that are not those which supervisord has started"""


class Action(NamedTuple):
    """What is to be done, and why."""

    verb: str
    """kill, end or revive"""
    program: str
    pid: int
    why: str


@dataclass(frozen=True)
class Patience:
    """How long the sentinel looks on [s]."""

    look: float = 0.25
    """between two looks"""
    silence: float = 2.7
    """for a service, which has to report its health once a second"""
    start: float = 10.0
    """for a new process, until its first report"""
    double: float = 1.0
    """for a double, which has to notice itself that it is one"""
    revival: float = 1.0
    """before the first revival; twice as long before each further one"""
    longest_revival: float = 60.0


class Judge:
    """Decides what is to be done."""

    def __init__(self, patience: Patience | None = None) -> None:
        self.confused = ""
        """why nothing is killed for its silence, in words; '' where the sentinel trusts what it hears"""
        self.reasons: dict[str, str] = {}
        """why a program was acted on last"""
        self.recent: dict[str, int] = {}
        """how often a program was restarted within the last minute"""
        self._patience = patience or Patience()
        # pid, when it was seen first, and how long its first report may take from then on [s]
        self._since: dict[str, tuple[int, float, float]] = {}
        self._deaf_since = math.inf
        self._stopped_since: dict[int, float] = {}
        self._double_since: dict[int, float] = {}
        self._revivals: dict[str, tuple[int, float]] = {}  # how often, and when the next is due
        self._restarts: dict[str, list[tuple[float, int]]] = {}  # when there were so many; the first is older
        self._looked: float | None = None
        self._lost = 0.0  # [s] that it was kept from looking
        self._heard: dict[tuple[str, int], tuple[float, float]] = {}  # by the clocks of the sight and its own

    def judge(self, sight: Sight) -> list[Action]:
        """What is to be done now."""
        sight = self._in_own_time(sight)
        self._count_restarts(sight)
        running = [program for program in sight.programs if program.state in ("STARTING", "RUNNING")]
        actions = self._kill_stopped(sight, running)
        actions += self._kill_silent(sight, [p for p in running if p.pid not in sight.stopped])
        actions += self._end_doubles(sight)
        actions += self._revive(sight)
        for action in actions:
            self.reasons[action.program] = action.why
        return actions

    def _in_own_time(self, sight: Sight) -> Sight:
        """
        The sight by a clock that stands still while the sentinel is kept from looking.

        A paused or overloaded machine keeps the services from reporting, too: that makes none of them silent.
        """
        if self._looked is not None:
            self._lost += max(0.0, sight.time - self._looked - 2 * self._patience.look)
        self._looked = sight.time
        before, self._heard = self._heard, {}
        for process, when in sight.heard.items():
            known = before.get(process)
            self._heard[process] = known if known and known[0] == when else (when, when - self._lost)
        heard = {process: when for process, (_, when) in self._heard.items()}
        return replace(sight, time=sight.time - self._lost, heard=heard)

    def _count_restarts(self, sight: Sight) -> None:
        """What dies again and again, but runs for a while each time, never gets FATAL."""
        for program in sight.programs:
            counts = self._restarts.setdefault(program.name, [(sight.time, program.restarts)])
            if program.restarts != counts[-1][1]:
                counts.append((sight.time, program.restarts))
            while len(counts) > 1 and sight.time - counts[1][0] >= MEMORY:
                del counts[0]
            self.recent[program.name] = max(0, program.restarts - counts[0][1])

    def _kill_stopped(self, sight: Sight, running: list[Watched]) -> list[Action]:
        """The kernel says that they are stopped: no network can err about that."""
        since = {pid: self._stopped_since.get(pid, sight.time) for pid in sight.stopped}
        self._stopped_since = since
        return [
            Action("kill", program.name, program.pid, f"stopped for {sight.time - since[program.pid]:.1f} s")
            for program in running
            if program.pid in since and sight.time - since[program.pid] >= self._patience.silence
        ]

    def _kill_silent(self, sight: Sight, running: list[Watched]) -> list[Action]:
        silent = []
        awaited = 0
        for program in running:
            pid, since, patience = self._since.get(program.name, (0, 0.0, 0.0))
            if pid != program.pid:
                # A new sentinel does not wait anew for what has had its time to start.
                pid, since = program.pid, sight.time
                patience = max(2 * self._patience.silence, self._patience.start - program.age)
                self._since[program.name] = (pid, since, patience)
            heard = sight.heard.get((program.name, pid))
            awaited += heard is not None or sight.time - since >= patience
            limit = patience if heard is None else self._patience.silence
            last = since if heard is None else heard
            if sight.time - last >= limit:
                silent.append(Action("kill", program.name, pid, f"no health for {sight.time - last:.1f} s"))
        self.confused = ""
        if itself := [action for action in silent if action.program == NAME]:
            self.confused = "it does not hear itself"
            self._deaf_since = min(self._deaf_since, sight.time)
            # It can do nothing for anybody, but its successor may.
            return itself if sight.time - self._deaf_since >= self._patience.start else []
        self._deaf_since = math.inf
        if len(silent) > 1 and 2 * len(silent) > awaited:
            self.confused = f"{len(silent)} of {awaited} services are silent at once"
        return [] if self.confused else silent

    def _end_doubles(self, sight: Sight) -> list[Action]:
        since = {double.pid: self._double_since.get(double.pid, sight.time) for double in sight.doubles}
        self._double_since = since
        return [
            Action("end", double.program, double.pid, f"process {double.pid} was its double")
            for double in sorted(sight.doubles)
            if sight.time - since[double.pid] >= self._patience.double
        ]

    def _revive(self, sight: Sight) -> list[Action]:
        actions = []
        for program in sight.programs:
            times, due = self._revivals.get(program.name, (0, float("nan")))
            delay = min(self._patience.revival * 2.0**times, self._patience.longest_revival)
            if program.state != "FATAL":
                if program.state == "RUNNING":
                    self._revivals.pop(program.name, None)
                elif times:
                    self._revivals[program.name] = (times, float("nan"))
            elif due != due:
                self._revivals[program.name] = (times, sight.time + delay)
            elif sight.time >= due:
                self._revivals[program.name] = (times + 1, float("nan"))
                actions.append(Action("revive", program.name, 0, f"given up; revived after {delay:g} s"))
        return actions
