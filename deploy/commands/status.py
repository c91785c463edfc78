"""The table of `make status`."""

from __future__ import annotations

import socket
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from deploy.supervision.columns import table
from deploy.supervision.supervisord import Program

if TYPE_CHECKING:  # it imports rclpy, which takes its time to load
    from interfaces.service.health import Health

HEADER = ("SERVICE", "STATE", "PID", "UPTIME", "RESTARTS", "LAST OUTPUT", "HEALTH")


def of_services(
    programs: Sequence[Program],
    healths: Mapping[tuple[str, str], Health],
    hosts: Mapping[str, str] | None = None,
) -> str:
    """Return the services, one per line, with the latest health of each.

    :param healths: by host and program.
    :param hosts: the host of each program, if there is more than one.
    """
    rows = [HEADER, *(_row(program, health_of(program, healths)) for program in programs)]
    if hosts:
        # An arm of an older checkout may have programs that this one does not know.
        column = ["HOST", *(hosts.get(program.name, "-") for program in programs)]
        rows = [(host, *row) for host, row in zip(column, rows, strict=True)]
    return table(rows)


def health_of(program: Program, healths: Mapping[tuple[str, str], Health]) -> Health | None:
    """Return the latest health of this very process; ``None`` if it has reported none.

    Processes of two hosts may have the same pid, those of two systems in a domain the same program.
    """
    health = healths.get((program.host or socket.gethostname(), program.name))
    return health if health and health.pid == program.pid else None


def _row(program: Program, health: Health | None) -> tuple[str, ...]:
    process = (str(program.pid), _duration(program.uptime)) if program.pid else ("-", "-")
    head = (program.name, program.state, *process, str(program.restarts))
    if health is None:
        return (*head, "-", "no report" if program.pid else "-")
    since = "never" if health.since_output is None else f"{_age(health):.1f} s ago"
    return (*head, since, "ok" if health.ok else health.reason)


def _age(health: Health) -> float:
    assert health.since_output is not None
    return health.since_output + time.monotonic() - health.heard


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"
