"""Accidents: a terminal closes, supervisord or make is killed. The system continues, or all of it ends."""

from __future__ import annotations

import os
import shlex
import signal

import pytest

from interfaces.loopback import LOOPBACK_DOWN
from tests.system.sites import STEADY, Site

STAYS_IN_THE_GRAPH = """
import sys, threading
from deploy.commands import launcher, member
member.Member.__exit__ = lambda *_: threading.Event().wait()
launcher.main(["run", sys.argv[1]])
"""
"""A terminal whose ROS node never ends."""


def test_closing_the_terminal_ends_everything(small_site: Site) -> None:
    terminal = small_site.begin_in_terminal("make", "run", f"SCENARIO={STEADY}")
    terminal.await_line("Engines are off")
    members = small_site.members
    terminal.signal(signal.SIGKILL)
    small_site.await_members(lambda left: not left)
    assert members.keys() == {"", *small_site.programs}


def test_nohup_keeps_it_running_when_the_terminal_closes(small_site: Site) -> None:
    launcher = [small_site.python, "-m", "deploy.commands.launcher"]
    command = small_site.begin_command("nohup", *launcher, "run", STEADY)
    command.await_line("Engines are off")
    command.signal(signal.SIGHUP)
    command.type("turn_on\n")
    command.await_line("Turning on engines")
    command.type("quit\n")
    assert command.wait() == 0


def test_system_ends_even_if_its_terminal_hangs_at_its_end(small_site: Site) -> None:
    command = small_site.begin_command(small_site.python, "-c", STAYS_IN_THE_GRAPH, STEADY)
    command.await_line("Engines are off")
    command.type("quit\n")
    small_site.await_members(lambda left: not left)


def test_the_end_of_a_pipe_ends_everything(small_site: Site) -> None:
    run = shlex.join([small_site.python, "-m", "deploy.commands.launcher", "run", STEADY])
    reader = small_site.begin_in_terminal("sh", "-c", f"{run} | head -n 1")
    reader.await_line("Starting the services")
    small_site.await_members(lambda left: not left)


def test_killing_make_ends_everything(small_site: Site) -> None:
    command = small_site.begin_command("make", "run", f"SCENARIO={STEADY}")
    command.await_line("Engines are off")
    os.kill(command.pid, signal.SIGKILL)
    small_site.await_members(lambda left: not left)
    command.wait()


def test_it_starts_again_when_supervisord_is_killed(small_site: Site) -> None:
    command = small_site.begin("run", STEADY)
    command.await_line("Engines are off")
    before = small_site.members
    os.kill(before[""], signal.SIGKILL)
    command.await_line("supervisord was killed: everything has started again")
    after = small_site.members
    assert set(after.values()).isdisjoint(before.values())
    command.type("quit\n")
    assert command.wait() == 0
    assert small_site.members == {}


def test_orphans_of_a_killed_supervisord_are_reported_until_they_are_stopped(small_site: Site) -> None:
    assert small_site.do("start", STEADY)[0] == 0
    terminal = small_site.begin("terminal")
    terminal.await_line("Engines are off")
    os.kill(small_site.members[""], signal.SIGKILL)
    terminal.await_line(f"supervisord has died; {len(small_site.programs)} services go on without it")
    assert terminal.wait() == 0
    assert small_site.members.keys() == small_site.programs
    code, printed = small_site.do("status")
    assert code == 1
    assert "supervisord has died" in printed
    assert small_site.do("stop")[0] == 0
    assert small_site.members == {}
    assert small_site.do("stop") == (0, "Nothing runs.")


def test_start_replaces_the_orphans_of_a_killed_supervisord(small_site: Site) -> None:
    assert small_site.do("start", STEADY)[0] == 0
    os.kill(small_site.members[""], signal.SIGKILL)
    small_site.await_members(lambda left: "" not in left)
    orphans = small_site.members
    assert orphans.keys() == small_site.programs
    assert small_site.do("start", STEADY)[0] == 0
    assert small_site.members.keys() == {"", *small_site.programs}
    assert set(small_site.members.values()).isdisjoint(orphans.values())


def test_a_loopback_that_goes_down_is_shown_by_terminal_and_status(small_site: Site) -> None:
    launcher = [small_site.python, "-m", "deploy.commands.launcher"]
    isolated = ["unshare", "--net", "--map-root-user", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    code, printed = small_site.do_command(*isolated, "true")
    if code:
        pytest.skip(f"platform: {printed}")
    command = small_site.begin_command(*isolated, *launcher, "run", STEADY)
    command.await_line("Engines are off")
    target = ["--target", str(small_site.members[""])]
    inside = ["nsenter", "--user", "--net", "--preserve-credentials", *target]
    assert small_site.do_command(*inside, "ip", "link", "set", "lo", "down") == (0, "")
    command.await_line(f"^loopback: {LOOPBACK_DOWN}")
    code, printed = small_site.do_command(*inside, *launcher, "status")
    assert (code, f"loopback: {LOOPBACK_DOWN}" in printed.splitlines()) == (0, True)
    assert all(f"{name} " in printed for name in small_site.programs)
    assert small_site.do_command(*inside, "ip", "link", "set", "lo", "up") == (0, "")
    command.await_line("^loopback: it is up again")
    command.type("quit\n")
    assert command.wait() == 0


def test_the_switch_stays_pressed_by_hand_when_its_process_dies(small_site: Site) -> None:
    signal_line = "Received signal from operator"
    command = small_site.begin("run", STEADY)
    command.await_line("Engines are off")
    command.insist("press\n", signal_line)
    switch = small_site.members["dead_mans_switch"]
    os.kill(switch, signal.SIGKILL)
    small_site.await_members(lambda left: left.get("dead_mans_switch", switch) != switch)
    for _ in range(3):  # the first may come from the dead process
        command.await_line(signal_line, after=len(command.lines))
    command.type("quit\n")
    assert command.wait() == 0
