from __future__ import annotations

import math
import re
import time
from typing import Any

import pytest
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from interfaces.topics import DRIVE_TIMEOUT, ENGINES_STATE, ON, Topic
from reactive_node.testing import SpinUntil, VirtualTime
from services.examples import twist_gate
from services.examples.twist_gate import gated
from tests.component.wiring import Connect


def test_commands_pass_only_while_they_are_permitted(scheduler: VirtualTime) -> None:
    commands = scheduler.hot(*((0.05 + 0.2 * n, n) for n in range(10)))
    permissions = scheduler.hot((0.5, True), (0.6, True), (1.1, False))
    found = scheduler.record(gated(commands, permissions, "zero"), until=1.45).items
    assert [(round(at, 2), it) for at, it in found] == [
        (0.65, 3),
        (0.85, 4),
        (1.05, 5),
        *((round(1.1 + 0.1 * n, 2), "zero") for n in range(4)),
    ]


def test_zero_follows_when_commands_stop(scheduler: VirtualTime) -> None:
    commands = scheduler.hot((0.1, 1), (0.55, 2), (0.9, 3), (1.75, 4))
    recording = scheduler.record(gated(commands, scheduler.hot((0.05, True)), "zero"), until=2.0)
    found = [(round(at, 2), it) for at, it in recording.items]
    zeros = [(round(1.4 + 0.1 * n, 2), "zero") for n in range(4)]
    assert found == [(0.1, 1), (0.55, 2), (0.9, 3), *zeros, (1.75, 4)]


def test_zero_follows_when_no_command_comes_at_all(scheduler: VirtualTime) -> None:
    recording = scheduler.record(gated(scheduler.hot(), scheduler.hot((0.05, True)), "zero"), until=0.7)
    assert [(round(at, 2), it) for at, it in recording.items] == [(0.55, "zero"), (0.65, "zero")]


def test_permission_that_is_repeated_prolongs_no_command(scheduler: VirtualTime) -> None:
    permissions = scheduler.hot(*((0.05 + 0.1 * n, True) for n in range(9)))
    recording = scheduler.record(gated(scheduler.hot((0.1, 1)), permissions, "zero"), until=0.75)
    assert [(round(at, 2), it) for at, it in recording.items] == [(0.1, 1), (0.6, "zero"), (0.7, "zero")]


def test_last_item_is_zero(scheduler: VirtualTime) -> None:
    commands = scheduler.hot(*((0.2 * n, n) for n in range(1, 9)))
    permissions = scheduler.hot((0.5, True)).take_until(scheduler.hot((0.9, None)))
    recording = scheduler.record(gated(commands, permissions, "zero"), until=2.0)
    assert [(round(at, 2), it) for at, it in recording.items] == [(0.6, 3), (0.8, 4), (0.9, "zero")]


RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT


def topic(kind: Any, name: str, reliability: ReliabilityPolicy = RELIABLE) -> Topic:
    return Topic(name, kind, QoSProfile(depth=1, reliability=reliability), "", (), (), "", raw=True)


@pytest.mark.parametrize(
    ("kind", "sent"), [(Twist, BEST_EFFORT), (Twist, RELIABLE), (TwistStamped, RELIABLE)]
)
def test_robot_stands_still_unless_the_engines_are_on(
    connect: Connect, spin_until: SpinUntil, kind: Any, sent: ReliabilityPolicy
) -> None:
    source, sink = topic(kind, "cmd_vel_in", sent), topic(kind, "cmd_vel")
    wired = connect(
        twist_gate.wire, inputs=[source, ENGINES_STATE], outputs=[sink], stamped=kind is TwistStamped
    )
    heard = wired.heard[sink.name]

    def speeds() -> list[float]:
        return [it.twist.linear.x if kind is TwistStamped else it.linear.x for it in heard]

    def command(speed: float) -> Any:
        message = kind()
        (message.twist if kind is TwistStamped else message).linear.x = speed
        if kind is TwistStamped:
            message.header.stamp.sec = 7  # the robot judges its age
        return message

    spin_until(lambda: speeds()[-2:] == [0.0, 0.0])
    wired.publish(source, command(1.0))
    wired.publish(ENGINES_STATE, String(data=ON))

    def drives() -> bool:
        wired.publish(source, command(2.0))
        wired.publish(ENGINES_STATE, String(data=ON))
        return speeds()[-1] == 2.0

    spin_until(drives)
    assert kind is Twist or heard[-1].header.stamp.sec == 7
    spin_until(lambda: speeds()[-1] == 0.0)  # nobody repeats the `on`
    assert {*speeds()} == {0.0, 2.0}
    if kind is TwistStamped:
        assert heard[-1].header.stamp.sec > 7
    (publisher,) = (each for each in wired.service.publishers if each.topic_name == "/cmd_vel")
    assert publisher.qos_profile.depth == 1  # a robot that reads late gets the newest velocity only


def test_command_that_is_no_number_is_dropped(connect: Connect, spin_until: SpinUntil) -> None:
    source = topic(Twist, "cmd_vel_in")
    wired = connect(twist_gate.wire, inputs=[source], outputs=[topic(Twist, "cmd_vel")])
    wired.publish(source, Twist(linear=Vector3(x=math.nan)))
    spin_until(lambda: wired.service.health.dropped)
    assert "cmd_vel_in: [nan, 0.0, 0.0, 0.0, 0.0, 0.0] is not finite" in wired.remarks()


def test_command_that_waited_while_the_gate_was_stopped_is_dropped(
    connect: Connect, spin_until: SpinUntil
) -> None:
    source, sink = topic(Twist, "cmd_vel_in"), topic(Twist, "cmd_vel")
    wired = connect(twist_gate.wire, inputs=[source, ENGINES_STATE], outputs=[sink])

    def drives() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))
        wired.publish(source, Twist(linear=Vector3(x=1.0)))
        return wired.heard[sink.name][-1:] == [Twist(linear=Vector3(x=1.0))]

    spin_until(drives)
    wired.publish(source, Twist(linear=Vector3(x=2.0)))
    time.sleep(DRIVE_TIMEOUT + 0.01)  # nothing spins: the gate is stopped
    wired.publish(ENGINES_STATE, String(data=ON))
    spin_until(lambda: wired.service.health.dropped)

    (remark,) = wired.remarks()
    assert re.fullmatch(r"cmd_vel_in: it is 0\.\d+ s old", remark)
    assert Twist(linear=Vector3(x=2.0)) not in wired.heard[sink.name]
