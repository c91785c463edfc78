"""What services and sentinel ask the kernel and supervisord for, besides what the simulation kit provides."""

from __future__ import annotations

import inspect
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from rclpy_simulation import Network, Process, Simulation
from rclpy_simulation.host import MIDNIGHT
from rclpy_simulation.process import running_process

from deploy.supervision import machine as running_machine
from deploy.supervision import probe, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import MARK
from deploy.supervision.supervisord import Supervisord
from interfaces.loopback import loopback_is_up
from interfaces.seam import replaced
from interfaces.service import host, unix_sockets
from interfaces.service.beats import Beats, beat
from interfaces.sources import scenario_file


@contextmanager
def simulated_services(
    seed: str, network: Network, supervisors: Callable[[], Iterable[Any]] = tuple, epoch: int = MIDNIGHT
) -> Iterator[Simulation]:
    """Simulate programs that are services until the end of the ``with``.

    :param supervisors: returns the present ones.
    :param epoch: the time of day at the beginning [ns since 1970].
    """
    with (
        Simulation(seed, network, epoch=epoch) as simulation,
        replaced(Machine(simulation, supervisors).answers()),
    ):
        yield simulation


def _host_name() -> str:
    return running_process().host.name


class Machine:
    """The process table and the sockets of the simulated hosts."""

    def __init__(self, simulation: Simulation, supervisors: Callable[[], Iterable[Any]]) -> None:
        """:param supervisors: returns the present ones."""
        self._simulation = simulation
        self._supervisors = supervisors
        self._claims: dict[tuple[str, str], Process] = {}
        self._beats: dict[int, float] = {}  # the last of each process, by pid

    def answers(self) -> dict[Callable[..., Any], Callable[..., Any]]:
        """Return what the simulation calls in place of the replaceable functions."""
        return {
            unix_sockets.bind: lambda address: _Claim(self._claims, address),
            unix_sockets.owners: self._owners,
            host.identity: _host_name,
            # Restarted sources read a file of many events again and again.
            scenario_file.load: cache(inspect.unwrap(scenario_file.load)),
            processes.stat_of: self._stat_of,
            processes.effort_of: lambda pid, stat: None,
            processes.of_system: self._of_system,
            processes.send_signal: self._send_signal,
            probe.is_here: lambda host: True,
            Beats.__init__: lambda beats, run: None,
            Beats.take: lambda beats: self._last_beats(),
            beat: self._beat,
            loopback_is_up: lambda: True,
            running_machine.datagrams: lambda: (0, 0),
            running_machine.disk_free: lambda run: math.inf,
            Supervisord.watch: lambda it: list(self._answering(it.pid).watch()),
            Supervisord.revive: lambda it, program: self._answering(it.pid).revive(program),
        }

    def _reachable(self) -> list[Process]:
        """Return the processes of the caller's host, and of hosts that are not cut off.

        The one supervisor and its sentinel stand for those of both hosts.
        """
        return [each for each in self._simulation.processes if self._reaches(each)]

    def _reaches(self, process: Process) -> bool:
        return not self._simulation.network.is_cut(process.host, running_process().host)

    def _find(self, pid: int) -> Process | None:
        same = (each for each in self._simulation.processes if each.pid == pid)
        return next((each for each in same if self._reaches(each)), None)

    def _stat_of(self, pid: int) -> list[str]:
        process = self._find(pid)
        return [] if process is None else ["T" if process.is_stopped else "S", str(process.parent_pid)]

    def _beat(self) -> None:
        self._beats[running_process().pid] = time.monotonic()

    def _last_beats(self) -> dict[int, float]:
        """Return those of the processes that the caller can reach."""
        return {each.pid: self._beats[each.pid] for each in self._reachable() if each.pid in self._beats}

    def _of_system(self, run: Path) -> list[processes.Process]:
        return [
            processes.Process(each.pid, each.environment["SUPERVISOR_PROCESS_NAME"])
            for each in self._reachable()
            if each.environment.get(MARK) == str(run)
        ]

    def _send_signal(self, run: Path, program: str, pid: int, number: int) -> bool:
        process = self._find(pid)
        owner = {MARK: str(run), "SUPERVISOR_PROCESS_NAME": program}
        if process is None or not owner.items() <= process.environment.items():
            return False
        process.send_signal(number)
        return True

    def _owners(self, prefix: str) -> dict[str, int]:
        """Return the user of each claim of the caller's host that begins so: there is one user."""
        host = running_process().host.name
        claims = {name for (where, name), owner in self._claims.items() if where == host and not owner.ended}
        return {name: os.geteuid() for name in claims if name.startswith(prefix)}

    def _answering(self, pid: int) -> Any:
        for supervisor in self._supervisors():
            if supervisor.pid == pid and supervisor.is_alive:
                return supervisor
        raise DeploymentError("supervisord does not answer")


class _Claim:
    """An abstract unix socket; its process or :meth:`close` frees the address."""

    def __init__(self, claims: dict[tuple[str, str], Process], address: str) -> None:
        process = running_process()
        self._claims = claims
        self._key = process.host.name, address
        owner = claims.get(self._key)
        if owner is not None and not owner.ended:
            raise OSError("Address already in use")
        claims[self._key] = process

    def close(self) -> None:
        self._claims.pop(self._key, None)

    def __enter__(self) -> _Claim:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
