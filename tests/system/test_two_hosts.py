"""An arm on two hosts: network namespaces with host names of their own, and a line between them.

Its processes have keys on an installed ROS 2, and on Cyclone DDS if its library has security.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest

from deploy.supervision import manifest
from deploy.supervision.environment import set_middleware
from deploy.supervision.processes import ROOT
from deploy.supervision.rclpy_choice import sourced_rclpy
from deploy.supervision.reaction import reaction
from tests.chaos import clock
from tests.chaos.faults import INJECTED
from tests.chaos.partition import BRIDGE, CONTROL, NETWORK, ROBOT, missing, namespaces
from tests.system.sites import LIMIT, Command, Site

pytestmark = pytest.mark.timed  # a busy terminal shows what happens seconds late

TABLET = "tablet"
SECURITY = Path(f"/usr/lib/{platform.machine()}-linux-gnu/libddsc.so.0debian")
HAS_SECURITY = SECURITY.exists() if os.environ.get("RUNTIME") else bool(sourced_rclpy())
KEYS = {"ROS_SECURITY_ENABLE": "true"} if HAS_SECURITY else {}
OPERATORS_KEYS = "dead_mans_switch operator_page sentinel_operator terminal"  # as deploy/README.md has it
ADDRESSES = {host: f"{NETWORK}.{number}" for number, host in enumerate((ROBOT, CONTROL, TABLET), start=1)}
QUICK = {
    "operator_watchdog": {"silence": 3.0, "strikes": 1},
    "engine_controller": {"presence_timeout": 6.0, "max_presence_age": 0.9},
}
PARAMETERS = f"""
operator_watchdog: {{ros__parameters: {QUICK["operator_watchdog"]}}}
engine_controller: {{ros__parameters: {QUICK["engine_controller"]}}}
operator_page:
  ros__parameters: {{address: 0.0.0.0, names: {ADDRESSES[CONTROL]}, certificate: page.pem, key: page.key}}
"""
OFF_WITHIN = reaction(QUICK).off_within + 2.0  # s: the rest is for the terminal on a busy machine
AS_HOST = 'hostname "$0" && exec "$@"'
HOLD_ON_PAGE = """
import ssl, sys, time
from tests.operator.page.clients import Hand

hand = Hand(sys.argv[1], ssl.create_default_context(cafile=sys.argv[2]))
while True:
    if hand.shown.get("switch", {}).get("by") != "this_page":
        hand.press()
    else:
        print("held", flush=True)
    hand.say("engines", command="turn_on")
    time.sleep(1.0)
"""


class Host:
    """One of the hosts."""

    def __init__(self, name: str, namespace: str, site: Site) -> None:
        self.name = name
        self.site = site
        self.keys = site.run.parent / f"keys_{name}"
        self._within = ["ip", "netns", "exec", namespace]

    def begin(self, *arguments: str, **environment: str) -> Command:
        """Begin a command of `make` on this host."""
        return self.begin_command(*self.site.command(arguments), **environment)

    def begin_command(self, *command: str, **environment: str) -> Command:
        within = [*self._within, "unshare", "--uts", "sh", "-c", AS_HOST, f"{self.name}-host"]
        own = KEYS | {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
            "ROS_SECURITY_KEYSTORE": str(self.keys),
            manifest.HOST: self.name,
        }
        return self.site.begin_alone([*within, *command], self.site.environment | own | environment)

    def do(self, *arguments: str, **environment: str) -> str:
        command = self.begin(*arguments, **environment)
        assert command.wait(2 * LIMIT) == 0, command.output
        return command.output

    def beside(self, run: Path) -> Host:
        """Return the same host with another run directory."""
        return Host(self.name, self._within[-1], Site(run, self.site.domain))

    def die(self) -> None:
        """Kill all processes of the arm on this host."""
        self.site.commands.close()
        while members := self.site.members:
            for pid in members.values():
                os.kill(pid, signal.SIGKILL)


class Arm:
    """The arm on both hosts, with a terminal on each."""

    def __init__(self, hosts: dict[str, Host], bridge: str, parameters: Path) -> None:
        self.robot, self.operator, self.tablet = hosts.values()
        self.parameters = parameters
        self._bridge = bridge
        if KEYS:
            self.robot.do("keystore", str(self.operator.keys), OPERATORS_KEYS)
        self.robot.do("start", "demo", str(parameters))
        self.view = self.robot.begin("terminal")
        self.start_operator()

    def start_operator(self, **environment: str) -> None:
        """Start the operator's side, with its terminal."""
        self.terminal = self.operator.begin("run", "demo", str(self.parameters), **environment)
        self.terminal.await_line("Lines that come too fast", 2 * LIMIT)

    def turn_on(self) -> None:
        """Hold the switch at the operator's terminal, and turn the engines on."""
        deadline = time.monotonic() + LIMIT
        while not self.is_on:
            assert time.monotonic() < deadline, self.terminal.output
            self.terminal.type("press\nturn_on\n")
            time.sleep(1.0)
        self.shown = len(self.view.lines)

    @property
    def is_on(self) -> bool:
        """Whether the engines are on, as the robot's terminal has shown last."""
        return re.findall(r"Engines are (\w+)", self.view.output)[-1:] == ["on"]

    def await_off(self) -> None:
        """Check that the engines go off in time from now on; they were on since :meth:`turn_on`."""
        self.view.await_line("Engines are off", OFF_WITHIN, self.shown)

    @contextmanager
    def cut(self) -> Iterator[None]:
        """Cut the operator's host off."""
        link = ["ip", "-n", self._bridge, "link", "set", CONTROL]
        subprocess.run([*link, "down"], check=True)
        try:
            yield
        finally:
            subprocess.run([*link, "up"], check=True)

    @contextmanager
    def cut_to(self, host: str) -> Iterator[None]:
        """Lose what is sent to a host, and nothing else: its port of the bridge has a queue of no length."""
        queue = ["tc", "-n", self._bridge, "qdisc"]
        subprocess.run([*queue, "replace", "dev", host, "root", "pfifo", "limit", "0"], check=True)
        try:
            yield
        finally:
            subprocess.run([*queue, "delete", "dev", host, "root"], check=True)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[Arm]:
    if reason := missing() or ("" if shutil.which("openssl") else "there is no openssl for a certificate"):
        pytest.skip(f"platform: {reason}")
    base = tmp_path_factory.mktemp("hosts")
    parameters = base / "parameters.yaml"
    parameters.write_text(PARAMETERS)
    kind = ["-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2"]
    subject = ["-subj", "/CN=arm", "-addext", f"subjectAltName=IP:{ADDRESSES[CONTROL]}"]
    files = ["-out", "page.pem", "-keyout", "page.key"]
    subprocess.run(["openssl", "req", *kind, *subject, *files], check=True, capture_output=True, cwd=base)
    with ExitStack() as stack:
        full = stack.enter_context(namespaces(ROBOT, CONTROL, TABLET))
        hosts = {
            name: Host(name, full(name), stack.enter_context(closing(Site(base / name, module_domain_id))))
            for name in ADDRESSES
        }
        yield Arm(hosts, full(BRIDGE), parameters)


def test_each_host_runs_its_programs_and_a_sentinel(arm: Arm) -> None:
    assert {"", "dead_mans_switch", "operator_page", "sentinel_operator"} == arm.operator.site.members.keys()
    ours = {each.name for each in manifest.programs()} - {"dead_mans_switch", "operator_page", "sentinel"}
    assert {"", *ours, "sentinel_robot"} == arm.robot.site.members.keys()


def test_second_start_reports_the_difference_of_the_clocks(arm: Arm) -> None:
    shown = arm.terminal.await_line(r"^Clocks: the clock of host robot-host is (\d+) ms \w.* ours$")
    assert int(shown[1]) <= 50


@pytest.mark.parametrize("name", [ROBOT, CONTROL])
def test_status_of_each_host_shows_both(arm: Arm, name: str) -> None:
    host = {ROBOT: arm.robot, CONTROL: arm.operator}[name]
    other = {ROBOT: CONTROL, CONTROL: ROBOT}[name]
    clocks = re.compile(rf"^Clocks: the clock of host {other}-host is \d+ ms ", re.MULTILINE)
    deadline = time.monotonic() + LIMIT
    rows: list[list[str]] = []
    printed = ""
    while (len(rows) < 15 or not clocks.search(printed)) and time.monotonic() < deadline:
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
    assert clocks.search(printed), printed


@pytest.mark.parametrize(
    ("command", "part", "words"),
    [
        ("start", "", r"^ROS domain \d+ is in use"),
        ("start", CONTROL, "^dead_mans_switch runs on host operator-host already"),
        ("become", CONTROL, "^dead_mans_switch runs on host operator-host already"),  # of a unit
    ],
)
def test_program_is_not_started_on_a_second_host(arm: Arm, command: str, part: str, words: str) -> None:
    second = arm.robot.beside(arm.robot.site.run.with_name("second"))
    with closing(second.site):
        refused = second.begin(command, "demo", "", **{manifest.HOST: part})
        assert refused.wait() == 1
        assert second.site.members == {}
    assert re.search(words, refused.output, re.MULTILINE)


def test_short_cut_keeps_the_engines_on_and_a_release_stops_them(arm: Arm) -> None:
    arm.turn_on()
    with arm.cut():
        time.sleep(0.2)
    time.sleep(2.0)
    assert arm.is_on
    arm.terminal.type("release\n")
    arm.await_off()


def test_operator_who_is_heard_no_more_stops_the_engines(arm: Arm) -> None:
    arm.turn_on()
    with arm.cut_to(ROBOT):
        arm.await_off()


def test_operator_who_hears_nothing_stops_the_engines_by_a_release(arm: Arm) -> None:
    arm.turn_on()
    with arm.cut_to(CONTROL):
        arm.terminal.type("release\n")
        arm.await_off()


def test_long_cut_stops_the_engines_until_they_are_turned_on(arm: Arm) -> None:
    arm.turn_on()
    with arm.cut():
        healed = time.monotonic() + 11.0
        arm.await_off()
        time.sleep(healed - time.monotonic())
    time.sleep(2.0)
    assert not arm.is_on
    arm.turn_on()


def test_second_controller_on_the_other_host_stops_the_joints(arm: Arm) -> None:
    arm.turn_on()
    environment = KEYS | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    set_middleware(environment)  # it keeps Fast DDS from shared memory, which a killed process leaves behind
    controller = [sys.executable, "-m", "services.engine_controller"]
    second = arm.operator.begin_command(*controller, **environment)
    if KEYS:
        assert second.wait() != 0
        assert re.search("keys_operator/enclaves/engine_controller", second.output), second.output
        keys = {"ROS_SECURITY_KEYSTORE": str(arm.robot.keys)}
        second = arm.operator.begin_command(*controller, **environment, **keys)
    arm.view.await_line("engine_controller: it runs on host operator-host as well", LIMIT, arm.shown)
    shown = len(arm.view.lines)
    time.sleep(2.0)
    assert not [text for _, text in arm.view.lines[shown:] if "Position" in text]
    second.close()
    arm.view.await_line("Position", LIMIT, len(arm.view.lines))
    time.sleep(2.0)  # so many lines about the engines have come that some were left out
    shown = len(arm.view.lines)
    arm.terminal.type("turn_off\n")
    arm.view.await_line("Engines are off", LIMIT, shown)


def test_page_on_a_third_host_holds_the_switch_by_tls(arm: Arm) -> None:
    arm.turn_on()
    arm.terminal.type("release\n")
    arm.await_off()
    shown = len(arm.view.lines)
    line = next(text for _, text in arm.terminal.lines if text.startswith("The page: "))
    assert line.startswith(f"The page: https://{ADDRESSES[CONTROL]}:")
    command = [sys.executable, "-c", HOLD_ON_PAGE, line, str(arm.parameters.parent / "page.pem")]
    tablet = arm.tablet.begin_command(*command, PYTHONPATH=os.pathsep.join([str(ROOT), *sys.path]))
    tablet.await_line("^held$")
    arm.view.await_line("Engines are on", LIMIT, shown)
    shown = len(arm.view.lines)
    tablet.close()
    arm.view.await_line("Engines are off", OFF_WITHIN, shown)


def test_host_that_dies_stops_the_engines(arm: Arm) -> None:
    arm.turn_on()
    arm.operator.die()
    arm.await_off()


def test_the_same_part_does_not_start_on_both_hosts_at_once(arm: Arm) -> None:
    arm.operator.die()
    second = arm.robot.beside(arm.robot.site.run.with_name("at_once"))
    with closing(second.site):
        starts = [
            host.begin("start", "demo", str(arm.parameters), **{manifest.HOST: CONTROL})
            for host in (arm.operator, second)
        ]
        codes = [each.wait(2 * LIMIT) for each in starts]
        assert any(codes)
        for code, each in zip(codes, starts, strict=True):
            assert code == 0 or re.search("runs on host (?:operator|robot)-host already", each.output)
    arm.operator.die()


# A wrong clock


def set_clock(host: Host, ahead: float) -> None:
    """Set the time of day of a host that has been started with :func:`faked` [s]."""
    file = host.site.run.parent / "ahead"
    new = file.with_suffix(".new")
    new.write_text(f"{ahead:+.3f}\n")
    new.replace(file)


@pytest.fixture
def faked(arm: Arm) -> Iterator[dict[str, str]]:
    """The environment of processes of the operator's host whose clock can be set."""
    if reason := clock.missing():
        pytest.skip(f"platform: {reason}")
    with clock.faked() as environment:
        yield environment | {
            "FAKETIME_TIMESTAMP_FILE": str(arm.operator.site.run.parent / "ahead"),
            "PYTHONPATH": os.pathsep.join([str(INJECTED), os.environ.get("PYTHONPATH", "")]),
        }


def test_host_with_a_wrong_clock_moves_nothing(arm: Arm, faked: dict[str, str]) -> None:
    arm.operator.die()
    set_clock(arm.operator, 60.0)
    refused = arm.operator.begin("start", "demo", str(arm.parameters), **faked)
    assert refused.wait() == 1
    assert re.search(
        r"^Clocks: the clock of host robot-host is [56].\.\d s behind ours;", refused.output, re.M
    )

    set_clock(arm.operator, 0.0)
    arm.start_operator(**faked)
    arm.turn_on()
    set_clock(arm.operator, 60.0)
    arm.await_off()
    set_clock(arm.operator, -0.2)
    arm.view.await_line(r"the clock of host operator-host is 2\d\d ms behind that of robot-host")
    words = "turn_on refused: the clock of host operator-host is more than 50 ms behind ours"
    arm.terminal.insist("press\nturn_on\n", words)
    assert not arm.is_on
    set_clock(arm.operator, 0.0)
    arm.turn_on()
