"""By how much the clocks of other hosts differ from ours (deploy/SAFETY.md, A3)."""

from __future__ import annotations

import math
import os
import socket
import time
from collections import defaultdict, deque
from contextlib import suppress

from diagnostic_msgs.msg import DiagnosticArray

from interfaces.service.health import healths
from interfaces.service.node import ServiceNode
from interfaces.topics import CLOCK_TOLERANCE, DIAGNOSTICS
from reactive_node import stamps

HOST = "REACTIVE_ARM_HOST"
"""Environment variable: which of two hosts this is; '' where one host runs all."""
WINDOW = 3.0  # s: each service reports its health once a second
_CLOCK = "clock of host "  # in a report, before the name
LEAST = 3  # reports in a window that tell a clock: each may be late


class Clocks:
    """The clocks of the other hosts of an arm, by the health reports of their services.

    A report is older at its arrival by the time of its way: the least age of some tells the clock.
    """

    def __init__(self, namespace: str) -> None:
        """:param namespace: that of the arm."""
        self._namespace = namespace.rstrip("/")
        self.awaited_until = -math.inf
        """Until when a first comparison is awaited, on the monotonic clock [s]."""
        self._ages: dict[str, deque[tuple[float, float]]] = defaultdict(deque)

    def hear(self, message: DiagnosticArray) -> None:
        age = (stamps.now() - stamps.from_message(message.header.stamp)).total_seconds()
        for health in healths(message, self._namespace).values():
            if health.host not in ("", socket.gethostname()):
                self._ages[health.host].append((health.heard, age))

    def behind(self) -> dict[str, float]:
        """Return by how much the clock of each other host that reports is behind ours [s]."""
        begin = time.monotonic() - WINDOW
        for ages in self._ages.values():
            while ages and ages[0][0] < begin:
                ages.popleft()
        known = {host: ages for host, ages in sorted(self._ages.items()) if len(ages) >= LEAST}
        return {host: min(age for _, age in ages) for host, ages in known.items()}

    def wrong(self) -> dict[str, float]:
        """Return those of :meth:`behind` that differ from ours by more than the tolerance."""
        return {host: behind for host, behind in self.behind().items() if abs(behind) > CLOCK_TOLERANCE}

    def problem(self) -> str:
        """Return which clock is wrong, in words that stay the same while it drifts; empty if none is."""
        for host, behind in self.wrong().items():
            return (
                f"the clock of host {host} is more than {1000 * CLOCK_TOLERANCE:.0f} ms {_way(behind)} ours"
            )
        return ""

    def objection(self) -> str:
        """Return why the engines may not be turned on, as yet; empty if they may."""
        if time.monotonic() < self.awaited_until and not self.behind():
            return "the clocks of the hosts are not compared yet"
        return self.problem()


def difference(host: str, behind: float, other: str = "ours") -> str:
    """Return in words by how much the clock of a host is behind another one [s]."""
    amount = f"{abs(behind):.1f} s" if abs(behind) >= 1.0 else f"{1000 * abs(behind):.0f} ms"
    return f"the clock of host {host} is {amount} {_way(behind)} {other}"


def _way(behind: float) -> str:
    return "behind" if behind > 0 else "ahead of"


def observe(node: ServiceNode) -> Clocks:
    """Return the clocks of the other hosts of the arm of a node, which reports them with its health."""
    clocks = Clocks(node.get_namespace())

    def hear(message: DiagnosticArray) -> None:
        clocks.hear(message)
        problem = clocks.problem()
        node.health.standing = {"clocks": problem} if problem else {}
        node.health.facts = {f"{_CLOCK}{host}": f"{behind:.3f}" for host, behind in clocks.behind().items()}

    if os.environ.get(HOST):
        # A host that says nothing for as long as a comparison takes does not run.
        clocks.awaited_until = time.monotonic() + WINDOW
        node.observe(DIAGNOSTICS).subscribe(hear, node.fail, scheduler=node.scheduler)
    return clocks


def reported(message: DiagnosticArray, namespace: str) -> dict[str, tuple[float, str]]:
    """Return by how much the clock of each host is behind that of another one, by the health reports."""
    found = {}
    for status in message.status:
        for pair in status.values:
            if pair.key.startswith(_CLOCK) and status.name.rpartition("/")[0] == namespace:
                with suppress(ValueError):  # not a report of ours
                    found[pair.key.removeprefix(_CLOCK)] = float(pair.value), status.hardware_id
    return found
