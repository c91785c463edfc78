"""A robot of the user's own: real joints, a real drive and a base that listens to cmd_vel."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from geometry_msgs.msg import Twist, Vector3
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header, String

from interfaces.topics import ENGINES, OPERATOR_HEARTBEAT, THETA1, TURN_ON
from tests.system.sites import Peer, Site

PERIOD = 0.05  # s between two messages of the hand, the driver and the joystick
BOUND = 2.2 + 0.5 + 0.1 + 0.4  # s: presence timeout, sampling, repetition and drive
SLACK = 0.5  # s: messages on their way, and a busy machine
MANIFEST = """
[program:joint_source]
command = python3 -m services.examples.joint_source --ros-args -r robot/joint_states:=/robot/joints
[program:drive_adapter]
command = python3 -m services.examples.drive_adapter
[program:twist_gate]
command = python3 -m services.examples.twist_gate
[program:own_guard]
command = python3 -m guard
"""
GUARD = """
from interfaces import service, topics

def wire(node):
    angles = node.observe(topics.THETA1)
    node.publish(topics.ENGINES, angles.filter(lambda angle: angle > 2.0).map(lambda _: topics.TURN_OFF))

if __name__ == "__main__":
    service.run("guard", wire)
"""
PARAMETERS = """
joint_source: {{ros__parameters: {{theta1: shoulder, theta2: elbow}}}}
drive_adapter: {{ros__parameters: {{file: '{pin}'}}}}
engine_controller: {{ros__parameters: {{presence_timeout: 2.2}}}}
"""


class Robot:
    """A base that integrates cmd_vel, the joints of an arm, and a hand on switch and joystick."""

    def __init__(self, peer: Peer, joystick: Peer) -> None:
        """:param joystick: another node: with the base, it would be a loop around the gate."""
        self.x = 0.0
        """Where the base is [m]."""
        self.holds = False
        self.angle = 0.5
        self._velocity, self._moved = 0.0, time.monotonic()
        self.peer, node = peer, peer.node
        node.create_subscription(Twist, "cmd_vel", self._on_velocity, 1)
        self._beats = peer.publisher(OPERATOR_HEARTBEAT)
        self._commands = peer.publisher(ENGINES)
        self._joystick = joystick.node.create_publisher(Twist, "cmd_vel_in", 1)
        self._joints = node.create_publisher(JointState, "/robot/joints", 10)
        node.create_timer(PERIOD, self._on_time)

    def turn_on(self) -> None:
        """Hold the switch and turn the engines on until the base moves."""
        self.holds, x = True, self.x
        while self.x == x:
            self._commands.publish(String(data=TURN_ON))
            self.spin(0.2)

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.peer.spin_once(0.05)

    def _on_velocity(self, message: Twist) -> None:
        self._move()
        self._velocity = message.linear.x

    def _on_time(self) -> None:
        self._move()
        if self.holds:
            self._beats.publish(Bool(data=True))
        self._joystick.publish(Twist(linear=Vector3(x=1.0)))
        now = self.peer.node.get_clock().now()
        positions = {"elbow": 0.25, "shoulder": self.angle}
        header = Header(stamp=now.to_msg())
        self._joints.publish(JointState(header=header, name=[*positions], position=[*positions.values()]))

    def _move(self) -> None:
        now = time.monotonic()
        self.x += self._velocity * (now - self._moved)
        self._moved = now


@pytest.fixture(scope="module")
def pin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file that turns the drive on."""
    pin = tmp_path_factory.mktemp("pin") / "value"
    pin.write_text("0\n")
    return pin


@pytest.fixture(scope="module")
def running(module_site: Site, pin: Path) -> Iterator[Robot]:
    """A robot under a running system without virtual sources."""
    (pin.parent / "guard.py").write_text(GUARD)
    (pin.parent / "robot.conf").write_text(MANIFEST)
    (pin.parent / "robot.yaml").write_text(PARAMETERS.format(pin=pin))
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("MANIFEST", str(pin.parent / "robot.conf"))
        environment.setenv("WEB", "off")
        code, printed = module_site.do("start", "none", str(pin.parent / "robot.yaml"))
    assert code == 0, printed  # other commands have another environment, as in another terminal
    domain = module_site.domain
    with closing(Peer(domain)) as peer, closing(Peer(domain, "joystick")) as joystick:
        yield Robot(peer, joystick)


@pytest.fixture
def robot(running: Robot) -> Robot:
    """The robot with nobody at its switch."""
    running.holds, running.angle = False, 0.5
    return running


def test_record_keeps_what_the_programs_of_the_user_publish_and_read(robot: Robot, module_site: Site) -> None:
    command = module_site.begin("record")
    command.await_line(r"Recording to /.*\.mcap until Ctrl-C")
    robot.spin(4.0)  # the recorder looks once a second
    command.signal(signal.SIGINT)
    assert command.wait() == 0
    (path,) = (module_site.run / "records").glob("*.mcap")
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        counts = {
            it.topic: it.msgcount for it in reader.connections if it.msgtype == "geometry_msgs/msg/Twist"
        }
    assert counts.keys() == {"/cmd_vel_in", "/cmd_vel"}
    assert min(counts.values()) > 10


def test_base_moves_only_while_a_hand_holds_the_switch(robot: Robot, pin: Path) -> None:
    robot.spin(1.0)
    assert robot.x == 0.0
    assert pin.read_text() == "0\n"

    robot.turn_on()
    robot.spin(0.5)
    assert robot.x > 0.3
    assert pin.read_text() == "1\n"

    robot.holds = False
    robot.spin(BOUND + SLACK)
    stood = robot.x
    robot.spin(1.0)
    assert robot.x == stood
    assert pin.read_text() == "0\n"


@pytest.mark.alone  # the traffic of many tests is a flood
def test_own_programs_are_supervised_and_are_the_only_joints(robot: Robot, module_site: Site) -> None:
    angles = robot.peer.collect(THETA1)
    robot.spin(1.5)
    assert {angle.data for angle in angles} == {0.5}
    publishers = robot.peer.node.get_publishers_info_by_topic("/theta1")
    assert [each.node_name for each in publishers] == ["joint_source"]

    status = module_site.begin("status")
    while status.is_alive:
        robot.spin(0.1)
    assert status.wait() == 0
    table = status.output[status.output.index("SERVICE") :].splitlines()[1:]
    rows = {line.split()[0]: line.split() for line in table}
    complaints = {name: " ".join(row) for name, row in rows.items() if row[-1] != "ok"}
    if "sentinel" in complaints:  # it may report only that this machine is busy
        assert complaints.pop("sentinel").endswith("the processor has too much to do")
    assert complaints == {}
    assert {"joint_source", "drive_adapter", "twist_gate", "own_guard", "config_l1"} <= rows.keys()
    assert not {"config_theta1", "config_theta2", "drive"} & rows.keys()

    killed = module_site.members["own_guard"]
    os.kill(killed, signal.SIGKILL)
    module_site.await_members(lambda members: members.get("own_guard", killed) != killed)
    robot.turn_on()
    robot.angle = 2.5  # the guard turns the engines off again
    robot.spin(1.5)
    stood = robot.x
    robot.spin(0.5)
    assert robot.x == stood


def test_drive_is_off_after_the_end(robot: Robot, module_site: Site, pin: Path) -> None:
    robot.turn_on()
    assert module_site.do("stop")[0] == 0
    assert pin.read_text() == "0\n"
