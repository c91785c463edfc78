"""The table of `make status`."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from deploy.running.columns import table
from deploy.running.supervisord import Program
from interfaces.service.health import Health

HEADER = ("SERVICE", "STATE", "PID", "UPTIME", "RESTARTS", "LAST OUTPUT", "HEALTH")


def of_services(
    programs: Sequence[Program], health: Mapping[str, Health], hosts: Mapping[str, str] | None = None
) -> str:
    """Return the services, one per line, with the latest health of each.

    :param hosts: the host of each program, if there is more than one.
    """
    rows = [HEADER, *(_row(program, health.get(program.name)) for program in programs)]
    if hosts:
        column = ["HOST", *(hosts[program.name] for program in programs)]
        rows = [(host, *row) for host, row in zip(column, rows, strict=True)]
    return table(rows)


def _row(program: Program, health: Health | None) -> tuple[str, ...]:
    process = (str(program.pid), _duration(program.uptime)) if program.pid else ("-", "-")
    head = (program.name, program.state, *process, str(program.restarts))
    if health is None or health.pid != program.pid:
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
