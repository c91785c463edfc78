"""Supervisor's own tools, and a checkout without .venv; in a checkout with an unpleasant path."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from deploy.supervision import manifest
from tests.system.sites import Checkout, Site

CONF = ("-c", "deploy/supervisord.conf")
PROGRAMS = {program.name for program in manifest.programs()}


def start_by_hand(checkout: Checkout) -> None:
    assert checkout.do_command("supervisord", *CONF) == (0, "")


def start_by_make(checkout: Checkout) -> None:
    code, printed = checkout.do("start", "demo")
    assert code == 0, printed


@pytest.mark.parametrize("start", [start_by_hand, start_by_make])
def test_supervisorctl_works(checkout: Checkout, start: Callable[[Checkout], None]) -> None:
    start(checkout)
    checkout.await_members(lambda left: left.keys() >= PROGRAMS)
    _, table = checkout.do_command("supervisorctl", *CONF, "status")
    rows = [line.split() for line in table.splitlines()]
    assert {row[0] for row in rows} == {f"arm:{name}" for name in PROGRAMS}
    assert {row[1] for row in rows} <= {"STARTING", "RUNNING"}
    before = checkout.members["kinematics"]
    code, printed = checkout.do_command("supervisorctl", *CONF, "restart", "arm:kinematics")
    assert (code, printed.splitlines()) == (0, ["arm:kinematics: stopped", "arm:kinematics: started"])
    assert checkout.members["kinematics"] != before
    tail = checkout.begin_command("supervisorctl", *CONF, "tail", "-f", "arm:operator_watchdog")
    tail.await_line("Press Ctrl-C to exit")
    with (checkout.run / "logs" / "operator_watchdog.log").open("a") as log:
        log.write("a line of the log\n")
    tail.await_line("a line of the log")
    assert checkout.do("stop")[1].splitlines()[-1] == "All have ended."
    assert checkout.members == {}


def test_a_start_by_hand_serves_the_commands_of_make(checkout: Checkout) -> None:
    start_by_hand(checkout)
    checkout.await_members(lambda left: left.keys() >= PROGRAMS)
    console = checkout.begin("console")
    console.await_line("Engines are on")
    code, table = checkout.do("status")
    assert code == 0
    assert len(table.splitlines()) == len(PROGRAMS) + 1
    code, printed = checkout.do_command("supervisord", *CONF)
    assert code == 1
    assert printed.startswith("Already running: supervisord has pid ")
    assert checkout.do_command("supervisorctl", *CONF, "shutdown") == (0, "Shut down")
    console.await_line("The system has ended")
    assert console.wait() == 0
    checkout.await_members(lambda left: not left)


def test_supervisorctl_reaches_another_run_directory(site: Site) -> None:
    assert site.do("start", "demo")[0] == 0
    ctl = str(Path(sys.executable).with_name("supervisorctl"))
    code, table = site.do_command(ctl, "-s", f"unix://{site.run}/supervisor.sock", "status")
    assert code in (0, 3)  # 3: a program is still STARTING
    assert len(table.splitlines()) == len(PROGRAMS)


def test_a_terminal_accepts_the_shutdown_of_supervisorctl(checkout: Checkout) -> None:
    command = checkout.begin("run", "demo")
    command.await_line("Engines are off")
    assert checkout.do_command("supervisorctl", *CONF, "shutdown") == (0, "Shut down")
    command.await_line("The system has ended")
    assert command.wait() == 0
    assert checkout.members == {}


def test_make_stop_needs_neither_venv_nor_run_directory(checkout: Checkout) -> None:
    start_by_make(checkout)
    (checkout.directory / ".venv").unlink()  # as `git clean -xfd` does
    shutil.rmtree(checkout.run)
    code, printed = checkout.do_command("make", "status")
    assert code != 0
    assert ".venv is not set up: make setup (make stop works without it)" in printed
    code, printed = checkout.do_command("make", "setup")
    assert code != 0
    assert "A running system uses this .venv. Stop it before the set-up: make stop\n" in printed
    code, printed = checkout.do_command("make", "stop")
    assert (code, printed.splitlines()[-1]) == (0, "All have ended.")
    assert checkout.members == {}
    assert checkout.do_command("make", "stop") == (0, "Nothing runs.")
