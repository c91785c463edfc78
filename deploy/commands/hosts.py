"""The other hosts of an arm: which programs they run, and by how much their clocks differ from ours."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rclpy.node import Node

from deploy.commands.member import Member
from deploy.supervision import manifest, processes
from deploy.supervision.environment import NAMESPACE, is_alone
from deploy.supervision.errors import DeploymentError
from deploy.supervision.probe import is_here
from deploy.supervision.sentinel import reported
from deploy.supervision.supervisord import Program
from deploy.supervision.system import System
from interfaces.limits import newest
from interfaces.plain_text import plain
from interfaces.service.clocks import Clocks, difference
from interfaces.service.health import Health, healths, listening
from interfaces.service.process import SUPERVISED

LOOK, LOOK_AGAIN = 2.0, 1.5  # s before and after a start: each service reports its health once a second
_TWICE = (
    "{program} runs on host {host} already, and a program runs on one host only: start the parts by"
    f" HOST=robot and HOST=operator, or give this arm another {NAMESPACE}"
)


class Hosts:
    """The reports of the services of an arm."""

    def __init__(self, namespace: str) -> None:
        """:param namespace: that of the arm."""
        self._namespace = namespace.rstrip("/")
        self._clocks = Clocks(namespace)
        self.healths: dict[tuple[str, str], Health] = {}
        """The latest health, by host and program."""
        self.processes: dict[str, Program] = {}
        """The processes as the sentinels see them, by program."""

    def hear(self, message: Any) -> None:
        self._clocks.hear(message)
        for program, health in healths(message, self._namespace).items():
            self.healths[health.host, program] = health
        self.healths = newest(self.healths)
        seen = {program.name: program for program in reported(message, self._namespace)}
        self.processes = newest(self.processes | seen)

    def clocks(self) -> str:
        """Return a line for each other host with the difference of its clock."""
        return "".join(f"Clocks: {plain(difference(*it))}\n" for it in self._clocks.differences().items())

    def check(self, ours: Mapping[int, str]) -> None:
        """Refuse a start beside these hosts.

        :param ours: the orphans of the last start, which this start replaces: their programs by pid.
        :raises DeploymentError: if another host runs one of our programs or has our name, or if its clock is
            wrong.
        """
        here = {program.name for program in manifest.programs()}
        elsewhere = {program.name for program in manifest.everywhere()} - here
        for (host, program), health in sorted(self.healths.items()):
            is_own = is_here(host) and ours.get(health.pid) == program
            if program in here and not is_own:
                raise DeploymentError(_TWICE.format(program=program, host=plain(host)))
            # Another host of our name would hide its clock. The other part may run on this host, too.
            if program in elsewhere and is_here(host) and not _is_process(health.pid, program):
                raise DeploymentError(
                    f"both hosts are named {host}: give each its own hostname (hostnamectl)"
                )
        for host, behind in self._clocks.wrong().items():
            raise DeploymentError(f"Clocks: {plain(difference(host, behind))}; synchronise both (NTP or PTP)")

    def check_again(self) -> None:
        """Raise DeploymentError if another host runs one of our programs."""
        here = {program.name for program in manifest.programs()}
        for host, program in sorted(self.healths):
            if program in here and not is_here(host):
                raise DeploymentError(_TWICE.format(program=program, host=plain(host)))


@contextmanager
def heard(node: Node) -> Iterator[Hosts]:
    """Listen to what the services of the arm of a node report."""
    hosts = Hosts(node.get_namespace())
    with listening(node, hosts.hear):
        yield hosts


@contextmanager
def checked(member: Member, system: System) -> Iterator[Callable[[], None]]:
    """Look for other hosts of the arm before a start.

    Yields a function that looks again: a host that started at the same moment is heard only now.

    :raises DeploymentError: if the arm must not start, or must not go on.
    """
    if is_alone(os.environ):
        yield lambda: None
        return
    ours = {process.pid: process.program for process in system.members()}
    with heard(member.node) as hosts:

        def look(seconds: float) -> None:
            deadline = time.monotonic() + seconds
            while time.monotonic() < deadline:
                member.spin_once()

        def look_again() -> None:
            look(LOOK_AGAIN)
            hosts.check_again()

        look(LOOK)
        hosts.check(ours)
        print(hosts.clocks(), end="")
        yield look_again


def _is_process(pid: int, program: str) -> bool:
    return processes.environment_of(pid).get(SUPERVISED) == program
