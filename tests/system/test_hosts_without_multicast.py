"""Two hosts without multicast: on Cyclone DDS they meet by the names of peers, on Fast DDS by a server."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from rclpy.utilities import get_rmw_implementation_identifier

from deploy.supervision import manifest
from deploy.supervision.environment import RANGE, set_middleware
from deploy.supervision.processes import ROOT
from tests.chaos.partition import BRIDGE, CONTROL, NETWORK, ROBOT, missing, namespaces
from tests.system.sites import LIMIT, STEADY, Command, Site

NAMES = f"127.0.0.1 localhost\n{NETWORK}.1 {ROBOT}.example\n{NETWORK}.2 {CONTROL}.example\n"
AS_HOST = 'hostname "$0-host" && mount --bind "$1" /etc/hosts && shift && exec "$@"'
IS_CYCLONE = get_rmw_implementation_identifier() == "rmw_cyclonedds_cpp"
SERVER = shutil.which("fast-discovery-server", path=f"{ROOT}/.venv/bin{os.pathsep}{os.environ['PATH']}")
PORT = 11811
PEERS = {
    ROBOT: {RANGE: "LOCALHOST", "ROS_STATIC_PEERS": f"{CONTROL}.example"},
    CONTROL: {RANGE: "LOCALHOST", "ROS_STATIC_PEERS": f"{ROBOT}.example"},
}
CLIENT = {RANGE: "SUBNET", "ROS_DISCOVERY_SERVER": f"{NETWORK}.1:{PORT}"}


class Host:
    """One of the hosts."""

    def __init__(self, name: str, namespace: str, base: Path, domain: int) -> None:
        self._site = Site(base / name, domain)
        self._within = ["ip", "netns", "exec", namespace]
        self._as_host = ["unshare", "--uts", "--mount", "sh", "-c", AS_HOST, name, str(base / "hosts")]
        way = PEERS[name] if IS_CYCLONE else CLIENT
        self._environment = self._site.environment | way | {manifest.HOST: name}
        set_middleware(self._environment)
        self.close = self._site.close

    def begin(self, *command: str) -> Command:
        return self._site.begin_alone([*self._within, *self._as_host, *command], self._environment)

    def launch(self, *arguments: str) -> Command:
        """Begin a command of `make`, without make."""
        return self.begin(sys.executable, "-m", "deploy.commands.launcher", *arguments)

    def status(self) -> str:
        command = self.launch("status")
        assert command.wait() == 0, command.output
        return command.output


@pytest.fixture
def hosts(tmp_path: Path, domain_id: int) -> Iterator[dict[str, Host]]:
    """The two hosts, on a line that carries no multicast."""
    if reason := missing() or ("" if IS_CYCLONE or SERVER else "there is no fast-discovery-server"):
        pytest.skip(f"platform: {reason}")
    (tmp_path / "hosts").write_text(NAMES)
    with ExitStack() as stack:
        full = stack.enter_context(namespaces(ROBOT, CONTROL))
        for host in (ROBOT, CONTROL):
            port = ["dev", host, "type", "bridge_slave", "mcast_flood", "off"]
            subprocess.run(["ip", "-n", full(BRIDGE), "link", "set", *port], check=True)
        hosts = {
            name: stack.enter_context(closing(Host(name, full(name), tmp_path, domain_id)))
            for name in (ROBOT, CONTROL)
        }
        if not IS_CYCLONE:
            server = hosts[ROBOT].begin(str(SERVER), "-i", "0", "-l", f"{NETWORK}.1", "-p", str(PORT))
            server.await_line("Server is running")
        yield hosts


def test_arm_on_two_hosts_needs_no_multicast(hosts: dict[str, Host]) -> None:
    for host in hosts.values():
        start = host.launch("start", STEADY)
        assert start.wait(2 * LIMIT) == 0, start.output
    view, terminal = (hosts[name].launch("terminal") for name in (ROBOT, CONTROL))
    terminal.insist("press\nturn_on\n", "Engines are on")
    view.await_line("Engines are on")
    for name, other in ((ROBOT, CONTROL), (CONTROL, ROBOT)):
        deadline = time.monotonic() + LIMIT
        while not shows_both(printed := hosts[name].status(), other):
            assert time.monotonic() < deadline, printed


def shows_both(status: str, other: str) -> bool:
    """Whether a status shows the clock of the other host, and all processes of both with their health."""
    rows = re.findall(rf"^(?:{ROBOT}|{CONTROL}) .* RUNNING (?!.*no report)", status, re.MULTILINE)
    return len(rows) == 15 and f"Clocks: the clock of host {other}-host is " in status
