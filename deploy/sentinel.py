"""The sentinel: keeps the services alive where supervisord does not notice that they are not.

User story (ours): as a robot operator, I find a service that hangs replaced within five seconds, and one that
was given up tried again, without anybody's help; and I see on /diagnostics what happened to which process.

It is a service like the others, supervised like them. It kills what reports no health, ends what lives beside
its supervised double, and revives what supervisord has given up, ever more patiently. Whoever guards must not
become the danger: where the sentinel itself, the network or supervisord may be what fails, it does nothing.
"""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from deploy import processes
from deploy.system import DeploymentError, System, Watched
from interfaces import service
from interfaces.service import ServiceNode
from interfaces.topics import DIAGNOSTICS

NAME = "sentinel"
MEETING = 0.3  # s after its start until it is discovered: what it says before may be lost


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
    """Decides what is to be done, from sight to sight. Pure: no clock, no process, no network."""

    def __init__(self, patience: Patience | None = None) -> None:
        self.confused = ""
        """why nothing is done, in words; '' where the sentinel trusts what it sees"""
        self.reasons: dict[str, str] = {}
        """why a program was acted on last"""
        self._patience = patience or Patience()
        self._since: dict[str, tuple[int, float]] = {}  # pid, and when it was seen first
        self._stopped_since: dict[int, float] = {}
        self._double_since: dict[int, float] = {}
        self._revivals: dict[str, tuple[int, float]] = {}  # how often, and when the next is due
        self._looked: float | None = None
        self._lost = 0.0  # [s] that it was kept from looking
        self._heard: dict[tuple[str, int], tuple[float, float]] = {}  # by the clocks of the sight and its own

    def judge(self, sight: Sight) -> list[Action]:
        """What is to be done now."""
        sight = self._in_own_time(sight)
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
            pid, since = self._since.get(program.name, (0, 0.0))
            if pid != program.pid:
                pid, since = self._since[program.name] = (program.pid, sight.time)
            heard = sight.heard.get((program.name, pid))
            awaited += heard is not None or sight.time - since >= self._patience.start
            limit = self._patience.start if heard is None else self._patience.silence
            last = since if heard is None else heard
            if sight.time - last >= limit:
                silent.append(Action("kill", program.name, pid, f"no health for {sight.time - last:.1f} s"))
        names = {action.program for action in silent}
        self.confused = ""
        if NAME in names:
            self.confused = "it does not hear itself"
        elif len(silent) > 1 and 2 * len(silent) > awaited:
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


class Eyes:
    """Sees the processes of the system that this process belongs to, and acts on them."""

    def __init__(self, system: System, supervisor: int) -> None:
        self._system = system
        self._supervisor = supervisor
        self._next_search = 0.0
        self._doubles: frozenset[processes.Process] = frozenset()

    def see(self, heard: Mapping[tuple[str, int], float]) -> Sight:
        """One look. Raises DeploymentError where supervisord does not answer."""
        if os.getppid() != self._supervisor:
            raise DeploymentError("supervisord has died: nobody would replace what is killed")
        programs = self._system.watch(self._supervisor)
        now = time.monotonic()
        if now >= self._next_search:
            self._next_search = now + 1.0
            self._doubles = self._find_doubles(programs)
        stopped = frozenset(p.pid for p in programs if p.pid and _state_of(p.pid)[0] == "T")
        return Sight(now, programs, dict(heard), stopped, self._doubles)

    def act(self, action: Action) -> None:
        """Do it, unless it is not so any more."""
        if action.verb == "revive":
            with suppress(DeploymentError):  # the next look tells whether it worked
                self._system.revive(self._supervisor, action.program)
            return
        for handle in processes.open_handles(self._system.run, [action.pid]):
            # Through the handle it hits this process, or none; and it is what it was taken for.
            if processes.environment_of(action.pid).get("SUPERVISOR_PROCESS_NAME") == action.program:
                with suppress(ProcessLookupError):
                    signal.pidfd_send_signal(handle, signal.SIGKILL)
            processes.close([handle])

    def _find_doubles(self, programs: list[Watched]) -> frozenset[processes.Process]:
        """What runs for a program, is not what supervisord has started, nor about to become it."""
        supervised = {program.name: program.pid for program in programs}
        return frozenset(
            process
            for process in processes.of_system(self._system.run)
            if supervised.get(process.program, process.pid) != process.pid
            and _state_of(process.pid)[1] not in (0, self._supervisor, *supervised.values())
        )


def _state_of(pid: int) -> tuple[str, int]:
    """State and parent of a process; ('', 0) if it has ended."""
    try:
        state, parent = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()[:2]
    except OSError:
        return "", 0
    return state, int(parent)


def states(programs: Iterable[Watched], reasons: Mapping[str, str], node: str) -> list[DiagnosticStatus]:
    """The states of the processes, as they are published."""
    return [_state(program, reasons.get(program.name, ""), node) for program in programs]


def _state(program: Watched, why: str, node: str) -> DiagnosticStatus:
    good = program.state in ("STARTING", "RUNNING")
    values = {
        "process": program.name,
        "state": program.state,
        "pid": program.pid,
        "restarts": program.restarts,
        "last exit": program.exit,
        "why": why or ("" if good else program.error),
    }
    return DiagnosticStatus(
        level=DiagnosticStatus.OK if good else DiagnosticStatus.ERROR,
        name=f"{node}: {program.name}",
        message=program.state
        if good
        else f"{program.state} after {program.restarts} restarts {program.error}".strip(),
        hardware_id=socket.gethostname(),
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


def wire(node: ServiceNode) -> None:
    """Connect the judge with what it sees and does."""
    patience = Patience(
        look=node.declare("look", 0.25, (0.05, 1.0), "it looks this often [s]"),
        silence=node.declare(
            "silence", 2.7, (1.5, 60.0), "a service that is silent for so long is killed [s]"
        ),
        start=node.declare("start", 10.0, (1.0, 300.0), "until its first report a service may take [s]"),
    )
    own = node.get_fully_qualified_name()
    namespace = node.get_namespace().rstrip("/")
    eyes = Eyes(System(Path(os.environ[processes.MARK])), os.getppid())
    judge = Judge(patience)
    heard: dict[tuple[str, int], float] = {}
    known: list[Watched] = []

    def listen(array: DiagnosticArray) -> None:
        for status in array.status:
            path, _, name = status.name.rpartition("/")
            pid = next((pair.value for pair in status.values if pair.key == "pid"), "")
            if path == namespace and pid.isdecimal():
                heard[name, int(pid)] = time.monotonic()

    def look(_: int) -> bool:
        """Look, and act; whether there is something new to tell."""
        nonlocal known
        try:
            sight = eyes.see(heard)
        except DeploymentError as error:
            node.remark(NAME, str(error))
            return False
        for action in judge.judge(sight):
            node.remark(action.program, f"{action.verb}: {action.why}")
            eyes.act(action)
        if judge.confused:
            node.remark(NAME, f"does nothing: {judge.confused}")
        before, known = known, list(sight.programs)
        for gone in heard.keys() - {(program.name, program.pid) for program in known}:
            del heard[gone]  # also what is of other hosts
        return known != before

    def message(_: object) -> DiagnosticArray:
        array = DiagnosticArray(status=states(known, judge.reasons, own))
        array.header.stamp = node.get_clock().now().to_msg()
        return array

    node.observe(DIAGNOSTICS).subscribe(listen, scheduler=node.scheduler)
    changes = rx.timer(0.0, patience.look).map(look).filter(bool)
    node.publish(DIAGNOSTICS, rx.merge(changes, rx.timer(MEETING, 1.0)).map(message))


def main() -> None:
    """Run the service."""
    service.run(NAME, wire)


if __name__ == "__main__":
    main()
