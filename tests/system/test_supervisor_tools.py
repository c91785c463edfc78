"""Supervisor's own tools, and a checkout without .venv; in a checkout with an unpleasant path."""

from __future__ import annotations

import shutil
import signal
from contextlib import closing
from pathlib import Path

from deploy.supervision.run_directory import SETTINGS
from tests.system.sites import Checkout, make_small_arm

CONF = ("-c", "deploy/supervisord.conf")


def test_supervisorctl_works(checkout: Checkout) -> None:
    code, printed = checkout.do("start", "demo")
    assert code == 0, printed
    _, table = checkout.do_command("supervisorctl", *CONF, "status")
    rows = [line.split() for line in table.splitlines()]
    assert {row[0] for row in rows} == {f"arm:{name}" for name in checkout.programs}
    assert {row[1] for row in rows} <= {"STARTING", "RUNNING"}
    before = checkout.members["engine_controller"]
    code, printed = checkout.do_command("supervisorctl", *CONF, "restart", "arm:engine_controller")
    assert (code, printed.splitlines()) == (
        0,
        [f"arm:engine_controller: {word}" for word in ("stopped", "started")],
    )
    assert checkout.members["engine_controller"] != before
    tail = checkout.begin_command("supervisorctl", *CONF, "tail", "-f", "arm:engine_controller")
    tail.await_line("Press Ctrl-C to exit")
    with (checkout.run / "logs" / "engine_controller.log").open("a") as log:
        log.write("a line of the log\n")
    tail.await_line("a line of the log")
    assert checkout.do("stop")[1].splitlines()[-1] == "All have ended."
    assert checkout.members == {}


def test_a_start_by_hand_serves_the_commands_of_make(checkout: Checkout) -> None:
    assert checkout.do_command("supervisord", *CONF) == (0, "")
    checkout.await_members(lambda left: left.keys() >= checkout.programs)
    terminal = checkout.begin("terminal")
    terminal.await_line("Received signal from operator")  # the demo has begun
    code, table = checkout.do("status")
    assert code == 0
    lines = len(table.splitlines())
    assert lines == 5 + len(checkout.programs)  # the system, its bounds, engines, hand, and titles
    code, printed = checkout.do_command("supervisord", *CONF)
    assert code == 1
    assert printed.startswith("Already running: supervisord has pid ")
    assert checkout.do_command("supervisorctl", *CONF, "shutdown") == (0, "Shut down")
    terminal.await_line("The system has ended")
    assert terminal.wait() == 0
    checkout.await_members(lambda left: not left)


def test_a_start_by_hand_in_the_foreground_prints_its_log(checkout: Checkout) -> None:
    supervisord = checkout.begin_command("supervisord", "-n", *CONF)
    supervisord.await_line("entered RUNNING state")
    checkout.await_members(lambda left: left.keys() >= checkout.programs)
    supervisord.signal(signal.SIGINT)
    assert supervisord.wait() == 0, supervisord.output
    assert "Traceback" not in supervisord.output
    assert checkout.members == {}


def test_make_stop_needs_neither_venv_nor_run_directory(tmp_path: Path, domain_id: int) -> None:
    with closing(Checkout(make_small_arm(tmp_path), domain_id)) as checkout:
        code, printed = checkout.do("start", "demo")
        assert code == 0, printed
        shutil.rmtree(checkout.directory / ".venv")  # as `git clean -xfd` does
        shutil.rmtree((checkout.run / SETTINGS).resolve())  # in memory
        checkout.run.rename(tmp_path / "removed")  # at once: its processes still write there
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
