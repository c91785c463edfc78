"""Two hosts without multicast: on Cyclone DDS they meet by the names of peers, on Fast DDS by a server."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
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
from tests.system.test_two_hosts import Host

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


class NamedHost(Host):
    """One of the hosts, on which both have names."""

    def begin_command(self, *command: str, **environment: str) -> Command:
        way = PEERS[self.name] if IS_CYCLONE else CLIENT
        settings = self.site.environment | way | {manifest.HOST: self.name} | environment
        set_middleware(settings)
        names = str(self.site.run.with_name("hosts"))
        as_host = ["unshare", "--uts", "--mount", "sh", "-c", AS_HOST, self.name, names]
        return self.site.begin_alone([*self._within, *as_host, *command], settings)


@pytest.fixture
def hosts(tmp_path: Path, domain_id: int) -> Iterator[dict[str, NamedHost]]:
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
            name: NamedHost(name, full(name), stack.enter_context(closing(Site(tmp_path / name, domain_id))))
            for name in (ROBOT, CONTROL)
        }
        if not IS_CYCLONE:
            server = hosts[ROBOT].begin_command(str(SERVER), "-i", "0", "-l", f"{NETWORK}.1", "-p", str(PORT))
            server.await_line("Server is running")
        yield hosts


def test_arm_on_two_hosts_needs_no_multicast(hosts: dict[str, NamedHost]) -> None:
    for host in hosts.values():
        start = host.begin("start", STEADY)
        assert start.wait(2 * LIMIT) == 0, start.output
    view, terminal = (hosts[name].begin("terminal") for name in (ROBOT, CONTROL))
    terminal.insist("press\nturn_on\n", "Engines are on")
    view.await_line("Engines are on")
    for name, other in ((ROBOT, CONTROL), (CONTROL, ROBOT)):
        deadline = time.monotonic() + LIMIT
        while not shows_both(printed := hosts[name].do("status"), other):
            assert time.monotonic() < deadline, printed


def shows_both(status: str, other: str) -> bool:
    """Whether a status shows the clock of the other host, and all processes of both with their health."""
    rows = re.findall(rf"^(?:{ROBOT}|{CONTROL}) .* RUNNING (?!.*no report)", status, re.MULTILINE)
    return len(rows) == 15 and f"Clocks: the clock of host {other}-host is " in status
