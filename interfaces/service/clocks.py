"""By how much the clocks of other hosts differ from ours (deploy/SAFETY.md, A3)."""

from __future__ import annotations

import math
import os
import socket
import time
from collections import defaultdict, deque
from contextlib import suppress

import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray
from reactivex import Observable
from reactivex.abc import DisposableBase, ObserverBase, SchedulerBase

from interfaces.arm_variables import HOST
from interfaces.limits import number
from interfaces.service.health import healths
from interfaces.service.node import ServiceNode
from interfaces.topics import CLOCK_TOLERANCE, DIAGNOSTICS
from reactive_node import stamps

WINDOW = 3.0  # s: each service reports its health once a second
PERIOD = 0.1  # s between two looks whether a host has fallen silent
_CLOCK = "clock of host "  # in a report, before the name
MOST_HOSTS, MOST_REPORTS = 8, 100  # that are compared, of each host: others choose how many they send
LEAST = 3  # reports in a window that show a clock: each may be late


class Clocks:
    """The clocks of the other hosts of an arm, by the health reports of their services.

    A report ages on its way: the youngest of some reports shows the clock.
    """

    def __init__(self, namespace: str) -> None:
        """:param namespace: that of the arm."""
        self._namespace = namespace.rstrip("/")
        self.awaited_until = -math.inf
        """Until when a first comparison is awaited, on the monotonic clock [s]."""
        self._ages: dict[str, deque[tuple[float, float]]] = defaultdict(lambda: deque(maxlen=MOST_REPORTS))

    def hear(self, message: DiagnosticArray) -> None:
        age = (stamps.now() - stamps.from_message(message.header.stamp)).total_seconds()
        for health in healths(message, self._namespace).values():
            is_known = health.host in self._ages or len(self._ages) < MOST_HOSTS
            if is_known and health.host not in ("", socket.gethostname()):
                self._ages[health.host].append((health.heard, age))

    def differences(self) -> dict[str, float]:
        """Return by how much the clock of each other host that reports is behind ours [s]."""
        begin = time.monotonic() - WINDOW
        for host, ages in [*self._ages.items()]:
            while ages and ages[0][0] < begin:
                ages.popleft()
            if not ages:
                del self._ages[host]
        known = {host: ages for host, ages in sorted(self._ages.items()) if len(ages) >= LEAST}
        return {host: min(age for _, age in ages) for host, ages in known.items()}

    def wrong(self) -> dict[str, float]:
        """Return those of :meth:`differences` that differ from ours by more than the tolerance."""
        return {host: behind for host, behind in self.differences().items() if abs(behind) > CLOCK_TOLERANCE}

    def problem(self) -> str:
        """Return which clock is wrong, in words that stay the same while it drifts; empty if none is."""
        for host, behind in self.wrong().items():
            return (
                f"the clock of host {host} is more than {1000 * CLOCK_TOLERANCE:.0f} ms {_way(behind)} ours"
            )
        return ""

    def refusal(self) -> str:
        """Return why `turn_on` is refused, as yet; empty if it is not."""
        if time.monotonic() < self.awaited_until and not self.differences():
            return "the clocks of the hosts are not compared yet"
        return self.problem()


def difference(host: str, behind: float, other: str = "ours") -> str:
    """Return in words by how much the clock of a host is behind another one [s]."""
    amount = f"{abs(behind):.1f} s" if abs(behind) >= 1.0 else f"{1000 * abs(behind):.0f} ms"
    return f"the clock of host {host} is {amount} {_way(behind)} {other}"


def _way(behind: float) -> str:
    return "behind" if behind > 0 else "ahead of"


def observe(node: ServiceNode) -> Observable[str]:
    """Emit why `turn_on` is refused, at once and at each change; nothing where one host runs all.

    The health of the node reports the clocks of the other hosts of its arm.
    """
    clocks = Clocks(node.get_namespace())

    def hear(message: DiagnosticArray) -> None:
        clocks.hear(message)
        problem = clocks.problem()
        node.health.standing = {"clocks": problem} if problem else {}
        node.health.facts = {
            f"{_CLOCK}{host}": f"{behind:.3f}" for host, behind in clocks.differences().items()
        }

    if not os.environ.get(HOST):
        return rx.empty()
    # A host that says nothing for as long as a comparison takes does not run.
    clocks.awaited_until = time.monotonic() + WINDOW
    heard = node.observe(DIAGNOSTICS).do_action(hear)
    looks = rx.merge(heard, rx.interval(PERIOD)).map(lambda _: clocks.refusal())

    def subscribe(observer: ObserverBase[str], scheduler: SchedulerBase | None = None) -> DisposableBase:
        observer.on_next(clocks.refusal())  # start_with would schedule it: a command could come first
        return looks.subscribe(observer, scheduler=scheduler)

    return rx.create(subscribe).distinct_until_changed()


def reported(message: DiagnosticArray, namespace: str) -> dict[str, tuple[float, str]]:
    """Return by how much the clock of each host is behind that of another one, by the health reports."""
    found = {}
    for status in message.status:
        for pair in status.values:
            if pair.key.startswith(_CLOCK) and status.name.rpartition("/")[0] == namespace:
                with suppress(ValueError):  # not a report of ours
                    found[pair.key.removeprefix(_CLOCK)] = number(pair.value), status.hardware_id
    return found
