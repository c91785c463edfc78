"""What the sentinel sees of the processes of its system, and how it acts on them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from contextlib import suppress

from deploy.supervision import processes
from deploy.supervision.policy import Action, Sight
from deploy.supervision.system import DeploymentError, System, Watched


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
    stat = processes.stat_of(pid)
    return (stat[0], int(stat[1])) if stat else ("", 0)
