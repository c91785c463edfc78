"""Notes start and end of every process of the observed arms, and long waits for a processor."""

from __future__ import annotations

import math
import os
import select
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from deploy.supervision import processes
from tests.promises.history import Life
from tests.promises.marks import BABBLER

STALL = 0.1  # s; the kernel schedules each thread within this time, or the machine is overloaded (A4)
SCAN_PERIOD = 0.02  # s
NAMING_TIMEOUT = 0.5  # s within which a new process shows its program
FORK_TIME = 0.2  # s for which a child of supervisord may look like supervisord


class Rounds:
    """The rounds of a loop that never takes long, unless its thread is not scheduled."""

    def __init__(self, overload: Callable[[float, float], None]) -> None:
        """:param overload: receives begin and end of each round that takes longer than :data:`STALL`."""
        self._overload = overload
        self._last = math.inf

    def note(self, now: float) -> None:
        """Note the end of a round [s]."""
        if now - self._last > STALL:
            self._overload(self._last, now)
        self._last = now


class ProcessMonitor:
    """Sees a new process within 20 ms, and the end of a process at once."""

    def __init__(
        self,
        runs: Mapping[Path, str],
        report: Callable[[str, Life], None],
        overload: Callable[[float, float], None],
    ) -> None:
        """:param runs: the run directory of each arm, and its namespace.
        :param report: receives the namespace and each new or ended process.
        :param overload: receives begin and end of each time in which the machine was overloaded.
        """
        self._namespaces = {str(run): namespace for run, namespace in runs.items()}
        self._report = report
        self._overload = overload
        self._rounds = Rounds(overload)
        self._poll = select.poll()
        self._known: set[int] = set()
        self._pending: dict[int, float] = {}  # new processes that do not show their program yet, since when
        self._alive: dict[int, tuple[str, Life]] = {}  # by pidfd
        self._waited: dict[int, float] = {}  # by pidfd

    def run(self, ended: threading.Event) -> None:
        self._rounds.note(time.monotonic())
        while not ended.is_set():
            self.scan()
            for handle, _ in self._poll.poll(SCAN_PERIOD * 1000):
                self._end(handle, time.monotonic())
            self._rounds.note(time.monotonic())
        for handle in list(self._alive):
            os.close(handle)

    def scan(self) -> None:
        pids = set(processes.all_pids())
        now = time.monotonic()
        self._pending |= dict.fromkeys(pids - self._known, now)
        self._known = pids
        for pid, since in list(self._pending.items()):
            age = now - since
            if self._identify(pid, age) or (age > NAMING_TIMEOUT and not self._is_child_of_supervisord(pid)):
                del self._pending[pid]
        for handle, (_, life) in self._alive.items():
            self._note_wait(handle, life.pid)

    def _note_wait(self, handle: int, pid: int) -> None:
        """Report an overload if a process waited too long for a processor since the last scan."""
        waited, now = _waiting_time(pid), time.monotonic()
        lasted = waited - self._waited.get(handle, waited)
        if lasted > STALL:
            self._overload(now - lasted, now)
        self._waited[handle] = waited

    def _identify(self, pid: int, age: float) -> bool:
        """Report a process that shows its arm and its program; return whether it does, or has ended."""
        environment = processes.environment_of(pid)
        namespace = self._namespaces.get(environment.get(processes.MARK, ""))
        program = environment.get("SUPERVISOR_PROCESS_NAME", "")
        if namespace is None or program == BABBLER or not (program or "supervisord" in _command(pid)):
            return False
        if not program and (age < FORK_TIME or self._is_child_of_supervisord(pid)):
            return False
        try:
            began = _start_time(pid)
            handle = os.pidfd_open(pid)
        except (OSError, ValueError, IndexError):
            return True
        life = Life(program, pid, began, None)
        self._alive[handle] = (namespace, life)
        self._poll.register(handle, select.POLLIN)
        self._report(namespace, life)
        return True

    def _is_child_of_supervisord(self, pid: int) -> bool:
        parent = processes.stat_of(pid)[1:2]
        return any(not life.program and [str(life.pid)] == parent for _, life in self._alive.values())

    def _end(self, handle: int, now: float) -> None:
        self._poll.unregister(handle)
        os.close(handle)
        namespace, life = self._alive.pop(handle)
        self._waited.pop(handle, None)
        self._report(namespace, life._replace(ended=now))


def _start_time(pid: int) -> float:
    """Return when a process was started [s], on the monotonic clock."""
    ticks = int(processes.stat_of(pid)[19])
    suspended = time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()
    return ticks / os.sysconf("SC_CLK_TCK") - suspended


def _waiting_time(pid: int) -> float:
    """Return how long the main thread of a process has waited for a processor until it ran last [s].

    It is 0 if the process has ended, or if the kernel does not count it (proc(5), schedstat).
    """
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, IndexError):
        return 0.0


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    except OSError:
        return ""
