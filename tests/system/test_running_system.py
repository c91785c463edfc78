"""A system in the background: its commands, its peers and its faults."""

from __future__ import annotations

import fcntl
import math
import os
import re
import signal
import stat
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, PointStamped
from std_msgs.msg import Bool, Float64, String

from deploy.supervision import processes
from deploy.supervision.processes import ROOT
from deploy.supervision.system import System
from interfaces import topics
from tests.system.sites import LIMIT, STEADY, Peer, Site


@pytest.fixture(scope="module", autouse=True)
def _system(module_site: Site) -> Iterator[None]:
    code, printed = module_site.do("start", STEADY)
    assert code == 0, printed
    yield
    assert module_site.do("stop")[0] == 0
    assert module_site.members == {}


def rows(table: str) -> dict[str, list[str]]:
    lines = table[table.index("SERVICE") :].splitlines()[1:]
    return {row[0]: row[1:] for row in (re.split(r"  +", line) for line in lines)}


def status(site: Site, until: Callable[[list[str]], bool], *command: str) -> dict[str, list[str]]:
    """The rows of `make status` once all fulfil a condition: the next report may be a second away.

    :param command: another one that prints the status.
    """
    deadline = time.monotonic() + LIMIT
    while True:
        code, printed = site.do_command(*command) if command else site.do("status")
        assert code == 0, printed
        services = rows(printed)
        if all(map(until, services.values())) or time.monotonic() > deadline:
            return services


def test_status_reports_the_runtime_and_the_address_of_the_page(module_site: Site) -> None:
    code, printed = module_site.do("status")
    assert code == 0, printed
    where, bound, page, engines, hand, header, *_ = printed.splitlines()
    assert where.startswith("rclpy of ")
    assert (" on Cyclone DDS" in where) == bool(os.environ.get("RUNTIME"))
    assert f"ROS domain {module_site.domain}" in where
    assert bound == "Let go: engines off within 10.05 s, or 10.5 s if programs crash"
    assert page == System(module_site.run).page
    assert page.startswith("The page: http://127.0.0.1:")
    assert re.fullmatch(r"Engines (on|off), (not )?turned o(n|ff) .*, \d+ s ago", engines)
    assert re.fullmatch("Released|Held by dead_mans_switch", hand)
    assert header.startswith("SERVICE")


def test_status_shows_every_service_running(module_site: Site) -> None:
    services = status(module_site, until=lambda row: row[0] == "RUNNING")
    assert services.keys() >= module_site.programs
    for name, (state, pid, _uptime, restarts, *_) in services.items():
        assert (state, int(pid), restarts) == ("RUNNING", module_site.members[name], "0")


@pytest.mark.parametrize("wrapped", [False, True], ids=["python", "venv.sh"])
def test_status_works_from_a_shell_of_the_other_runtime(
    module_site: Site, monkeypatch: pytest.MonkeyPatch, wrapped: bool
) -> None:
    monkeypatch.setenv("RUNTIME", "" if os.environ.get("RUNTIME") else "cyclonedds")
    for name in ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"):  # as in a new shell
        monkeypatch.delenv(name, raising=False)
    python = str(ROOT / "deploy/commands/venv.sh") if wrapped else sys.executable
    command = python, "-m", "deploy.commands.launcher", "status"
    services = status(module_site, lambda row: row[-1] != "no report", *command)
    assert {row[0] for row in services.values()} == {"RUNNING"}
    assert "no report" not in {row[-1] for row in services.values()}


def test_a_second_start_reports_the_running_system(module_site: Site) -> None:
    for command in ("start", "run"):
        code, printed = module_site.do(command, STEADY)
        assert code == 1
        where = f"supervisord has pid {module_site.members['']} and works in {module_site.run}"
        assert printed == f"Already running: {where}. make terminal shows it, make stop ends it"


def test_a_second_system_in_the_same_domain_is_refused(module_site: Site, tmp_path: Path) -> None:
    before = module_site.members
    with closing(Site(tmp_path / "second", module_site.domain)) as second:
        code, printed = second.do("start", STEADY)
        assert code == 1
        assert printed == (
            f"ROS domain {module_site.domain} is in use: the system in {module_site.run} has /config_l1. Set"
            " ROS_DOMAIN_ID to another domain (0 to 101), or REACTIVE_ARM_NAMESPACE, for example to /arm2."
        )
        assert second.members == {}
        assert not second.run.exists()
    assert module_site.members == before


def test_only_its_user_reaches_supervisord(module_site: Site) -> None:
    socket = module_site.run / "supervisor.sock"
    assert stat.S_IMODE(socket.stat().st_mode) == 0o700
    assert stat.S_IMODE(module_site.run.stat().st_mode) == 0o700
    sockets = set()
    for link in Path(f"/proc/{module_site.members['']}/fd").iterdir():
        with suppress(FileNotFoundError):  # of a finished call of the sentinel
            sockets.add(os.readlink(link))
    tables = [Path(f"/proc/net/{family}").read_text().splitlines()[1:] for family in ("tcp", "tcp6")]
    assert not [line for table in tables for line in table if f"socket:[{line.split()[9]}]" in sockets]


def test_a_cleaner_of_tmp_leaves_the_run_directory_alone(module_site: Site) -> None:
    directory = os.open(module_site.run, os.O_RDONLY)
    try:
        # systemd-tmpfiles needs this lock to clean a directory and what is below it.
        with pytest.raises(BlockingIOError):
            fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        os.close(directory)


def test_services_are_forks_of_supervisord(module_site: Site) -> None:
    begins_of_stack = {processes.stat_of(pid)[25] for pid in module_site.members.values()}
    assert len(begins_of_stack) == 1, "it is random for each new interpreter"


def test_each_service_has_a_log_of_its_own(module_site: Site) -> None:
    assert {path.stem for path in (module_site.run / "logs").glob("*.log")} >= module_site.programs


def test_a_late_joiner_gets_the_latched_configuration_and_position(peer: Peer) -> None:
    heard = {name: peer.collect(topic) for name, topic in topics.CONFIGURATION.items()}
    positions = peer.collect(topics.EFFECTOR_POSITION)
    peer.spin_until(lambda: positions and all(heard.values()))
    assert [heard[name][-1].data for name in ("l1", "l2", "theta1", "theta2")] == [2.0, 3.0, 0.0, 0.0]
    assert (positions[-1].point.x, positions[-1].point.y) == (5.0, 0.0)


BAD = [
    (topics.L1, Float64(data=-1.0), "kinematics"),
    (topics.L1, Float64(data=math.nan), "kinematics"),
    (topics.L2, Float64(data=math.inf), "kinematics"),
    (topics.THETA1, Float64(data=-math.inf), "kinematics"),
    (topics.THETA2, Float64(data=math.nan), "kinematics"),
    (topics.EFFECTOR_POSITION, PointStamped(point=Point(x=math.nan)), "velocity"),
    (topics.OPERATOR_HEARTBEAT, Bool(data=False), "operator_watchdog"),
    (topics.ENGINES, String(data="explode"), "engine_controller"),
]
"""Bad messages, each with the service that has to report it."""


@pytest.mark.parametrize(("topic", "message", "reporter"), BAD)
def test_a_bad_value_is_dropped_and_reported(
    module_site: Site, peer: Peer, topic: topics.Topic, message: object, reporter: str
) -> None:
    before = module_site.members
    health = peer.collect(topics.DIAGNOSTICS)
    positions, speeds = peer.collect(topics.EFFECTOR_POSITION), peer.collect(topics.EFFECTOR_SPEED)
    publisher = peer.publisher(topic)

    def is_reported() -> bool:
        publisher.publish(message)
        statuses = [status for array in health for status in array.status if status.name == f"/{reporter}"]
        return any(status.level == status.WARN and topic.name in status.message for status in statuses)

    peer.spin_until(is_reported)
    assert module_site.members == before
    assert topic is topics.EFFECTOR_POSITION or all(math.isfinite(position.point.x) for position in positions)
    assert all(math.isfinite(speed.data) and speed.data >= 0 for speed in speeds)


def test_a_killed_service_comes_back_and_is_counted(module_site: Site, peer: Peer) -> None:
    killed = module_site.members["kinematics"]
    positions = peer.collect(topics.EFFECTOR_POSITION)
    peer.spin_until(lambda: positions)
    os.kill(killed, signal.SIGKILL)
    peer.spin_until(lambda: len(positions) > 1)  # the first one of the new process, at once
    assert (positions[-1].point.x, positions[-1].point.y) == (5.0, 0.0)
    state, pid, _uptime, restarts, *_ = rows(module_site.do("status")[1])["kinematics"]
    assert state in ("STARTING", "RUNNING")
    assert (int(pid), restarts) == (module_site.members["kinematics"], "1")
    assert int(pid) != killed


def test_a_killed_service_comes_back_though_its_log_does_not_open(module_site: Site) -> None:
    killed = module_site.members["velocity"]
    logs, away = module_site.run / "logs", module_site.run / "away"
    logs.rename(away)
    logs.touch()
    try:
        os.kill(killed, signal.SIGKILL)
        module_site.await_members(lambda left: left.get("velocity", killed) != killed)
    finally:
        logs.unlink()
        away.rename(logs)


@pytest.mark.parametrize("in_terminal", [False, True], ids=["plain", "prompt"])
def test_the_operator_commands_switch_and_engines_from_the_terminal(
    module_site: Site, in_terminal: bool
) -> None:
    begin = module_site.begin_in_terminal if in_terminal else module_site.begin_command
    terminal = begin(sys.executable, "-m", "deploy.commands.launcher", "terminal")
    terminal.await_line("Let go: engines off within 10.05 s")
    terminal.await_line("Engines are off, ")
    terminal.insist("press\n", "Operator is alive")
    terminal.insist("turn_on\n", "Engines are on")
    terminal.type("turn_off\n")
    terminal.await_line(r"Turning off engines, as terminal_\d+ asked\.\.\.")
    terminal.type("release\nfly\n")
    terminal.await_line(r"fly\? Commands: press, release, turn_on, turn_off, quit")
    terminal.await_line("Not received signal from operator")
    terminal.type("quit\n")
    assert terminal.wait() == 0
    assert module_site.members.keys() >= module_site.programs


def test_what_is_typed_just_before_quit_is_obeyed(module_site: Site) -> None:
    launcher = (sys.executable, "-m", "deploy.commands.launcher", "terminal")
    terminal = module_site.begin_command(*launcher)
    terminal.await_line("Engines are off")
    terminal.insist("press\n", "Operator is alive")
    terminal.type("release\nquit\n")
    assert terminal.wait() == 0

    # On a busy machine, the next terminal may come after all strikes; the last one is repeated.
    module_site.begin_command(*launcher).await_line("Not received signal from operator|Turning off engines")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_terminal_that_is_killed_or_stopped_is_a_silent_operator(
    module_site: Site, peer: Peer, number: signal.Signals
) -> None:
    terminal = module_site.begin_command(sys.executable, "-m", "deploy.commands.launcher", "terminal")
    terminal.await_line("Engines are off")
    terminal.insist("press\n", "Operator is alive")
    heartbeats = peer.collect(topics.OPERATOR_HEARTBEAT)
    peer.spin_until(lambda: len(heartbeats) > 5)

    os.kill(terminal.pid, number)
    spin_for(peer, 0.5)
    heartbeats.clear()
    spin_for(peer, 1.5)
    assert heartbeats == []

    if number == signal.SIGSTOP:
        os.kill(terminal.pid, signal.SIGCONT)
        terminal.await_line("because this terminal stood still. Press again.")
        heartbeats.clear()
        spin_for(peer, 0.5)
        assert heartbeats == []


def spin_for(peer: Peer, seconds: float) -> None:
    end = time.monotonic() + seconds
    peer.spin_until(lambda: time.monotonic() > end)


def test_another_terminal_may_have_sourced_another_rclpy(
    module_site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text("raise ImportError('made for another Python')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    services = status(module_site, until=lambda row: row[-1] != "no report")
    assert "no report" not in {row[-1] for row in services.values()}


@pytest.mark.alone  # the traffic of many tests is a flood
def test_a_second_arm_runs_in_a_namespace_of_the_same_domain(
    module_site: Site, peer: Peer, tmp_path: Path
) -> None:
    first = module_site.members
    health = peer.collect(topics.DIAGNOSTICS)
    parameters = tmp_path / "mine.yaml"
    parameters.write_text("dead_mans_switch: {ros__parameters: {pressed: true}}")
    with closing(Site(tmp_path / "run", module_site.domain, "/second")) as second:
        command = second.begin("run", STEADY, str(parameters))
        command.await_line(f"ROS domain {second.domain}, namespace /second ...")
        command.await_line("Position x")
        command.await_line("Operator is alive")
        nodes = {f"/second/{program}" for program in second.programs}

        def all_are_well() -> bool:
            levels = {it.name: it.level for report in health for it in report.status if it.name in nodes}
            return levels == dict.fromkeys(nodes, DiagnosticStatus.OK)

        # The discovery of a second arm is a flood for seconds, and `make status` adds 30,000 datagrams.
        # On Cyclone DDS, nobody else meets an arm in a namespace.
        if not os.environ.get("RUNTIME"):
            peer.spin_until(all_are_well)
        second.namespace = ""  # as in another terminal
        services = status(second, until=lambda row: row[-1] != "no report")
        assert services.keys() == second.programs
        assert "no report" not in {row[-1] for row in services.values()}
        fleet = second.begin_command(
            "env", "RUNTIME=cyclonedds", second.python, "-m", "deploy.commands.fleet"
        )
        for name, engines in ((module_site.namespace or "/", r"\w+"), ("/second", "off")):
            fleet.await_line(rf"^{name} +{second.domain} +\S+ +\S+ +{engines} +{len(services)} ok +10\.5 s$")
        command.type("quit\n")
        assert command.wait() == 0
        fleet.await_line(r"^/second .* silent +silent ")
    assert module_site.members == first
