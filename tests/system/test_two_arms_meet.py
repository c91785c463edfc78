"""Two whole arms, started on two hosts that were cut from each other, in network namespaces."""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from deploy.supervision import manifest
from deploy.supervision.processes import ROOT
from deploy.supervision.system import System
from tests.chaos.partition import BRIDGE, CONTROL, ROBOT, missing, namespaces, set_port
from tests.system.sites import LIMIT, Command, Site
from tests.system.test_two_hosts import Host

SCENARIO = """
theta1: {{center: 0.8, amplitude: 0.5, period: 12.0}}
theta2: {{center: 0.8, amplitude: 0.5, period: 12.0}}
l1: 2.0
l2: 2.0
operator: {{pressed: [{{from: 0.0, to: {released}}}]}}
engines: [{{at: 1.0, command: turn_on}}, {{at: 2.0, command: turn_on}}]
drive: {{}}
"""
RELEASED = {ROBOT: 4.0, CONTROL: 6.0}  # s: so the drives stand at different times
PLAIN = {"ROS_SECURITY_ENABLE": "false", manifest.HOST: "", "WEB": "off"}
TWINS = {each.name for each in manifest.programs()} - {manifest.PAGE, manifest.SENTINEL}
"""The programs that must be named; those of the page and the sentinel may be as well."""
ANGLES = 100
OBSERVE = f"""
import rclpy
from std_msgs.msg import Float64
rclpy.init()
node, heard = rclpy.create_node("observer"), []
node.create_subscription(Float64, "theta1", lambda message: heard.append(message.data), 100)
while len(heard) < {ANGLES}:
    rclpy.spin_once(node)
print("angles", len(set(heard)), flush=True)
node.destroy_node()
rclpy.shutdown()
"""


class TwoArms:
    def __init__(self, hosts: dict[str, Host], bridge: str) -> None:
        self.robot, self.second = hosts.values()
        self._bridge = bridge
        set_port(bridge, CONTROL, "nomaster")
        for host in hosts.values():
            scenario = host.site.run.parent / f"{host.name}.yaml"
            scenario.write_text(SCENARIO.format(released=RELEASED[host.name]))
            quick = str(ROOT / "deploy" / "quick.yaml")
            started = host.begin("start", str(scenario), quick, **PLAIN)
            assert started.wait(2 * LIMIT) == 0, started.output
        self.view = self.robot.begin("terminal", **PLAIN)
        self._await_released(self.robot)
        self._await_released(self.second)

    def _await_released(self, host: Host) -> None:
        terminal = host.begin("terminal", **PLAIN)
        terminal.await_line("Turning off engines", 2 * LIMIT)  # the operator is away
        terminal.close()

    def meet(self) -> None:
        set_port(self._bridge, CONTROL, "master", "bridge")

    def angles(self) -> int:
        """Return how many different angles the joint has now."""
        observer: Command = self.robot.begin_command(
            "deploy/commands/venv.sh", "-c", OBSERVE, **PLAIN, ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET"
        )
        found = int(observer.await_line(r"^angles (\d+)$", LIMIT)[1])
        assert observer.wait() == 0, observer.output  # killed, it would leave shared memory of Fast DDS
        return found

    def doubled(self) -> set[str]:
        """Return the programs of the second host, as the sentinel of the first one names them."""
        found: set[str] = set()
        deadline = time.monotonic() + LIMIT
        while not found >= TWINS and time.monotonic() < deadline:
            found |= {*re.findall(rf"(\w+): it runs on host {CONTROL}-host as well", self._status())}
        return found

    def _status(self) -> str:
        return self.robot.do("status", **PLAIN)

    def kill(self, host: Host, program: str) -> None:
        killed = host.site.members[program]
        os.kill(killed, signal.SIGKILL)
        host.site.await_members(lambda members: members.get(program, killed) != killed)


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[TwoArms]:
    if reason := missing():
        pytest.skip(f"platform: {reason}")
    base: Path = tmp_path_factory.mktemp("arms")
    with ExitStack() as stack:
        full = stack.enter_context(namespaces(ROBOT, CONTROL))
        hosts = {
            name: Host(name, full(name), stack.enter_context(closing(Site(base / name, module_domain_id))))
            for name in RELEASED
        }
        yield TwoArms(hosts, full(BRIDGE))


def test_arms_that_meet_name_each_other_and_no_joint_moves(arms: TwoArms) -> None:
    assert arms.angles() == 1
    arms.meet()
    arms.view.await_line(
        rf"^\[\d+\] config_theta\d: driven_time: the drive of host {CONTROL}-host publishes it"
    )
    assert arms.doubled() >= TWINS

    # From now on, all angles in the network are those of the robot's joint.
    System(arms.second.site.run).halt("config_theta1")
    assert arms.angles() == 1
    for victim in ("config_theta1", "drive", "config_theta1"):
        arms.kill(arms.robot, victim)
        assert arms.angles() == 1
    arms.kill(arms.second, "drive")
    assert arms.angles() == 1
