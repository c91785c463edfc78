"""What services and sentinel ask the kernel and supervisord for, besides what the simulation kit provides."""

from __future__ import annotations

import math
import signal
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from rclpy_simulation import Network, Process, Simulation
from rclpy_simulation.process import running_process

from deploy.supervision import machine as running_machine
from deploy.supervision import probe, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import MARK
from deploy.supervision.supervisord import Supervisord
from interfaces.service import instance
from interfaces.service import process as service_process
from interfaces.sources import scenario_file


@contextmanager
def simulated_services(
    seed: str, network: Network, supervisor: Callable[[], Any] = lambda: None
) -> Iterator[Simulation]:
    """Simulate programs that are services until the end of the ``with``."""
    variables = [(vars(service_process), "_end_of_spin")]
    with (
        Simulation(seed, network, variables=variables) as simulation,
        Machine(simulation, supervisor).installed(),
    ):
        yield simulation


class Machine:
    """The process table and the sockets of the simulated hosts."""

    def __init__(self, simulation: Simulation, supervisor: Callable[[], Any]) -> None:
        """:param supervisor: returns the present supervisor."""
        self._simulation = simulation
        self._supervisor = supervisor
        self._claims: dict[tuple[str, str], Process] = {}

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Answer for the kernel and supervisord until the end of the ``with``."""
        sockets = SimpleNamespace(
            AF_UNIX=socket.AF_UNIX, SOCK_STREAM=socket.SOCK_STREAM, socket=lambda *_: _Claim(self._claims)
        )
        with (
            mock.patch.object(instance, "socket", sockets),
            # Restarted sources read a file of many events again and again.
            mock.patch("interfaces.sources.player.load", cache(scenario_file.load)),
            mock.patch.multiple(
                processes,
                stat_of=self._stat_of,
                environment_of=self._environment_of,
                of_system=self._of_system,
                open_handles=self._open_handles,
                close=lambda handles: None,
            ),
            mock.patch.object(probe, "is_here", return_value=True),
            mock.patch.multiple(
                running_machine,
                loopback_is_up=lambda: True,
                shutil=SimpleNamespace(disk_usage=lambda run: SimpleNamespace(free=math.inf)),
            ),
            mock.patch.multiple(
                Supervisord,
                watch=lambda it: list(self._answering(it.pid).watch()),
                revive=lambda it, program: self._answering(it.pid).revive(program),
            ),
            mock.patch.object(signal, "pidfd_send_signal", self._send),
        ):
            yield

    def _reachable(self) -> list[Process]:
        """Return the processes of the caller's host, and of hosts that are not cut off.

        The one supervisor and its sentinel stand for those of both hosts.
        """
        host, network = running_process().host, self._simulation.network
        return [each for each in self._simulation.processes if not network.is_cut(each.host, host)]

    def _find(self, pid: int) -> Process | None:
        return next((each for each in self._reachable() if each.pid == pid), None)

    def _stat_of(self, pid: int) -> list[str]:
        process = self._find(pid)
        return [] if process is None else ["T" if process.is_stopped else "S", str(process.parent_pid)]

    def _environment_of(self, pid: int) -> dict[str, str]:
        process = self._find(pid)
        return {} if process is None else dict(process.environment)

    def _of_system(self, run: Path) -> list[processes.Process]:
        return [
            processes.Process(each.pid, each.environment["SUPERVISOR_PROCESS_NAME"])
            for each in self._reachable()
            if each.environment.get(MARK) == str(run)
        ]

    def _open_handles(self, run: Path, pids: Iterable[int]) -> list[int]:
        return [pid for pid in pids if self._environment_of(pid).get(MARK) == str(run)]

    def _send(self, handle: int, number: int) -> None:
        process = self._find(handle)
        if process is None:
            raise ProcessLookupError
        process.send_signal(number)

    def _answering(self, pid: int) -> Any:
        supervisor = self._supervisor()
        if supervisor.pid != pid or not supervisor.is_alive:
            raise DeploymentError("supervisord does not answer")
        return supervisor


class _Claim:
    """An abstract unix socket; its process or :meth:`close` frees the address."""

    def __init__(self, claims: dict[tuple[str, str], Process]) -> None:
        self._claims = claims
        self._key: tuple[str, str] | None = None

    def bind(self, address: str) -> None:
        process = running_process()
        key = (process.host.name, address)
        owner = self._claims.get(key)
        if owner is not None and not owner.ended:
            raise OSError("Address already in use")
        self._claims[key] = process
        self._key = key

    def close(self) -> None:
        if self._key is not None:
            self._claims.pop(self._key, None)

    def __enter__(self) -> _Claim:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
