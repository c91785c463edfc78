from __future__ import annotations

import math
from typing import Any

import pytest
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from interfaces.topics import ENGINES_STATE, ON, Topic
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services.examples import twist_gate
from services.examples.twist_gate import gated
from tests.component.wiring import Wired


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
    make_node: MakeNode, spin_until: SpinUntil, kind: Any, sent: ReliabilityPolicy
) -> None:
    source, sink = topic(kind, "cmd_vel_in", sent), topic(kind, "cmd_vel")
    wired = Wired(
        make_node,
        spin_until,
        twist_gate.wire,
        inputs=[source, ENGINES_STATE],
        outputs=[sink],
        stamped=kind is TwistStamped,
    )
    heard = wired.heard[sink.name]

    def speeds() -> list[float]:
        return [it.twist.linear.x if kind is TwistStamped else it.linear.x for it in heard]

    def command(speed: float) -> Any:
        message = kind()
        (message.twist if kind is TwistStamped else message).linear.x = speed
        return message

    spin_until(lambda: speeds()[-2:] == [0.0, 0.0])
    wired.publish(source, command(1.0))
    wired.publish(ENGINES_STATE, String(data=ON))

    def drives() -> bool:
        wired.publish(source, command(2.0))
        wired.publish(ENGINES_STATE, String(data=ON))
        return speeds()[-1] == 2.0

    spin_until(drives)
    spin_until(lambda: speeds()[-1] == 0.0)  # nobody repeats the `on`
    assert {*speeds()} == {0.0, 2.0}
    if kind is TwistStamped:
        assert heard[-1].header.stamp.sec > 0


def test_command_that_is_no_number_is_dropped(make_node: MakeNode, spin_until: SpinUntil) -> None:
    source = topic(Twist, "cmd_vel_in")
    wired = Wired(make_node, spin_until, twist_gate.wire, inputs=[source], outputs=[topic(Twist, "cmd_vel")])
    wired.publish(source, Twist(linear=Vector3(x=math.nan)))
    spin_until(lambda: wired.service.health.dropped)
    assert wired.remarks() == ["cmd_vel_in: [nan, 0.0, 0.0, 0.0, 0.0, 0.0] is not finite"]
