from __future__ import annotations

import socket
import time

import pytest

from deploy.commands.status import health_of, of_services
from deploy.supervision.supervisord import Program
from interfaces.service.health import Health

HERE = socket.gethostname()


def health(pid: int, *, since_output: float | None = 0.0, reason: str = "") -> Health:
    return Health(time.monotonic(), pid, not reason, reason, since_output, HERE)


def test_the_table_shows_each_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    programs = [
        Program("kinematics", "RUNNING", 101, 3725.9, 2, "", ""),
        Program("velocity", "RUNNING", 102, 5.0, 0, "", ""),
        Program("operator_watchdog", "RUNNING", 103, 1.0, 1, "", ""),
        Program("engine_controller", "BACKOFF", 0, 0.0, 7, "", ""),
    ]
    reports = {
        (HERE, "kinematics"): health(101, since_output=0.2, reason="l1: nan is not finite"),
        (HERE, "velocity"): health(102, since_output=None),
        (HERE, "operator_watchdog"): health(99),  # the previous process
        (HERE, "engine_controller"): health(104),
    }
    assert of_services(programs, reports).splitlines() == [
        "SERVICE            STATE    PID  UPTIME   RESTARTS  LAST OUTPUT  HEALTH",
        "kinematics         RUNNING  101  1:02:05  2         0.2 s ago    l1: nan is not finite",
        "velocity           RUNNING  102  0:00:05  0         never        ok",
        "operator_watchdog  RUNNING  103  0:00:01  1         -            no report",
        "engine_controller  BACKOFF  -    -        7         -            -",
    ]


def test_process_of_another_host_with_the_same_pid_is_no_match() -> None:
    ours = Program("drive", "RUNNING", 7, 1.0, 0, "", "")
    theirs = ours._replace(host="desk")
    own, other = health(7), health(7, reason="slow")
    assert health_of(ours, {("desk", "drive"): other}) is None
    both = {("desk", "drive"): other, (HERE, "drive"): own}
    assert health_of(ours, both) is own
    assert health_of(theirs, both) is other


def test_the_table_names_the_hosts_if_there_are_two() -> None:
    programs = [Program("drive", "RUNNING", 7, 1.0, 0, "", ""), Program("page", "RUNNING", 7, 1.0, 0, "", "")]
    head, *rows = of_services(programs, {}, {"drive": "robot", "page": "operator"}).splitlines()
    assert head.split()[:2] == ["HOST", "SERVICE"]
    assert [row.split()[:2] for row in rows] == [["robot", "drive"], ["operator", "page"]]


def test_the_table_shows_a_program_that_this_checkout_does_not_know() -> None:
    programs = [Program("motion", "RUNNING", 7, 1.0, 0, "", "")]
    _, row = of_services(programs, {}, {"drive": "robot"}).splitlines()
    assert row.split()[:2] == ["-", "motion"]
