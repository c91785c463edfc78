"""An arm on two hosts: network namespaces with host names of their own, and a line between them."""

from __future__ import annotations

import re
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from deploy.running import manifest
from deploy.trials.chaos.partition import BRIDGE, CONTROL, NETWORK, ROBOT, missing, namespaces
from tests.system.sites import LIMIT, Command, Site

OFF_WITHIN = 15.0  # s: S1's 10.5 s, and the way to the terminal of a busy machine
AS_HOST = 'hostname "$0" && exec "$@"'


class Host:
    """One of the two hosts."""

    def __init__(self, name: str, namespace: str, site: Site) -> None:
        self.name = name
        self.site = site
        self._within = ["ip", "netns", "exec", namespace]

    def begin(self, *arguments: str, **environment: str) -> Command:
        """Begin a command of `make` on this host."""
        within = [*self._within, "unshare", "--uts", "sh", "-c", AS_HOST, f"{self.name}-host"]
        own = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", manifest.HOST: self.name}
        command = [*within, *self.site._command(arguments)]
        return self.site.begin_alone(command, self.site.environment | own | environment)

    def do(self, *arguments: str, **environment: str) -> str:
        command = self.begin(*arguments, **environment)
        assert command.wait() == 0, command.output
        return command.output

    def ip(self, *arguments: str) -> None:
        subprocess.run([*self._within, "ip", *arguments], check=True)


class Arm:
    """The arm on both hosts, with its operator's terminal."""

    def __init__(self, robot: Host, operator: Host, cut: Callable[[str], None]) -> None:
        self.robot, self.operator, self.cut = robot, operator, cut
        self.started = robot.do("start", "demo")
        self.terminal = operator.begin("run", "demo")
        self.terminal.await_line("Lines that come too fast", 2 * LIMIT)

    def turn_on(self) -> None:
        """Hold the switch at the operator's terminal, and turn the engines on."""
        deadline = time.monotonic() + LIMIT
        while not self.is_on:
            assert time.monotonic() < deadline, self.terminal.output
            self.terminal.type("press\nturn_on\n")
            time.sleep(1.0)

    @property
    def is_on(self) -> bool:
        """Whether the engines are on, as the terminal has shown last."""
        return re.findall(r"Engines are (\w+)", self.terminal.output)[-1:] == ["on"]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[Arm]:
    if reason := missing():
        pytest.skip(reason)
    base = tmp_path_factory.mktemp("hosts")
    with ExitStack() as stack:
        full = stack.enter_context(namespaces())
        hosts = [
            Host(name, full(name), stack.enter_context(closing(Site(base / name, module_domain_id))))
            for name in (ROBOT, CONTROL)
        ]

        def cut(state: str) -> None:
            link = ["ip", "-n", full(BRIDGE), "link", "set", CONTROL, state]
            subprocess.run(link, check=True)

        yield Arm(hosts[0], hosts[1], cut)


def test_each_host_runs_its_programs_and_a_sentinel(arm: Arm) -> None:
    assert {"", "dead_mans_switch", "operator_page", "sentinel_operator"} == arm.operator.site.members.keys()
    ours = {each.name for each in manifest.programs()} - {"dead_mans_switch", "operator_page", "sentinel"}
    assert {"", *ours, "sentinel_robot"} == arm.robot.site.members.keys()


def test_second_start_tells_the_difference_of_the_clocks(arm: Arm) -> None:
    shown = arm.terminal.await_line(r"^Host robot-host: its clock is (\d+) ms (behind|ahead of) ours$")
    assert int(shown[1]) <= 50


@pytest.mark.parametrize("name", [ROBOT, CONTROL])
def test_status_of_each_host_shows_both(arm: Arm, name: str) -> None:
    host = {ROBOT: arm.robot, CONTROL: arm.operator}[name]
    deadline = time.monotonic() + LIMIT
    rows: list[list[str]] = []
    while len(rows) < 15 and time.monotonic() < deadline:
        printed = host.do("status")
        lines = [line for line in printed.splitlines() if "RUNNING" in line and "no report" not in line]
        rows = [line.split() for line in lines]
    assert len(rows) == 15, printed
    assert {(row[0], row[1]) for row in rows} >= {
        (ROBOT, "engine_controller"),
        (ROBOT, "sentinel_robot"),
        (CONTROL, "operator_page"),
        (CONTROL, "sentinel_operator"),
    }
    other = {ROBOT: CONTROL, CONTROL: ROBOT}[name]
    assert re.search(rf"^Host {other}-host: its clock is \d+ ms ", printed, re.MULTILINE), printed


@pytest.mark.parametrize("part", ["", ROBOT])
def test_program_is_not_started_on_a_second_host(arm: Arm, part: str, tmp_path: Path) -> None:
    with closing(Site(tmp_path / "run", arm.robot.site.domain)) as site:
        # Another network namespace has other claims of its own.
        third = Host(CONTROL, arm.operator._within[-1], site)
        command = third.begin("start", "demo", **{manifest.HOST: part})
        assert command.wait() == 1
        assert site.members == {}
    assert re.search(r"^\w+ (runs on host \w+-host already|already runs)|is in use", command.output, re.M)


def test_short_cut_keeps_the_engines_on_and_a_release_stops_them(arm: Arm) -> None:
    arm.turn_on()
    shown = len(arm.terminal.lines)
    arm.cut("down")
    time.sleep(0.2)
    arm.cut("up")
    time.sleep(2.0)
    assert arm.is_on
    arm.terminal.type("release\n")
    arm.terminal.await_line("Engines are off", OFF_WITHIN, shown)


def test_operator_who_is_heard_no_more_stops_the_engines(arm: Arm) -> None:
    arm.turn_on()
    shown = len(arm.terminal.lines)
    # Only the way from the operator to the robot is cut: the terminal still shows the robot.
    arm.operator.ip("route", "add", "blackhole", f"{NETWORK}.1")
    try:
        arm.terminal.await_line("Engines are off", OFF_WITHIN, shown)
    finally:
        arm.operator.ip("route", "del", "blackhole", f"{NETWORK}.1")
    arm.turn_on()
