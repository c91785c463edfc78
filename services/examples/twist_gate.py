"""Lets the velocity commands of a robot pass while the engines are on, and stops the robot otherwise.

User story (ours): as an operator of a mobile robot, I drive it only while I hold the switch.

Commands come on `cmd_vel_in`, the robot listens to `cmd_vel`. Zero follows when no command has come for
0.5 s, and the last message of this process is zero. A robot that stops when `cmd_vel` falls silent stops in
time even if this process is killed; another one waits until supervisord has started the process again.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import reactivex as rx
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from reactivex import Observable

from interfaces import permission, service, topics
from interfaces.topics import DRIVE_TIMEOUT


def _not_finite(command: Any) -> str:
    twist = getattr(command, "twist", command)
    parts = [part for it in (twist.linear, twist.angular) for part in (it.x, it.y, it.z)]
    return "" if all(map(math.isfinite, parts)) else f"{parts} is not finite"


COMMANDS = topics.Topic(
    "cmd_vel_in",
    Twist,
    QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),  # meets every publisher
    "m/s, rad/s",
    ("teleoperation or navigation",),
    ("twist_gate",),
    "wanted velocity",
    _not_finite,
    raw=True,
)
REPEAT = 0.1  # s: the zero is repeated, so that a base that starts later gets it
SILENCE = 0.5  # s without a command: then the last one is over, as for the base of ros2_controllers


def gated(commands: Observable[Any], permissions: Observable[bool], zero: Any) -> Observable[Any]:
    """Emit the commands while they are permitted, and ``zero`` otherwise, at once and repeatedly.

    ``zero`` comes as well when no command has come for 0.5 s. It ends with the permissions, and its last item
    is ``zero``.
    """

    def velocities(permissions: Observable[bool]) -> Observable[Any]:
        passing = (
            commands.with_latest_from(permissions).filter(lambda pair: pair[1]).map(lambda pair: pair[0])
        )
        waits = permissions.switch_map(
            lambda permitted: (
                commands.map(lambda _: SILENCE).start_with(SILENCE) if permitted else rx.just(0.0)
            )
        )
        standing = waits.switch_map(lambda wait: rx.timer(wait, REPEAT)).map(lambda _: zero)
        last = permissions.ignore_elements().default_if_empty(zero)
        return rx.merge(passing.take_until(last), standing.take_until(last), last)

    return permissions.distinct_until_changed().publish(velocities)


@dataclass(frozen=True)
class Parameters:
    stamped: bool = service.parameter(
        False, None, "", "whether the commands are TwistStamped instead of Twist"
    )


def wire(node: service.ServiceNode) -> None:
    kind = TwistStamped if node.declare(Parameters).stamped else Twist
    source = replace(COMMANDS, type=kind)
    reliable = QoSProfile(depth=1)  # which meets every robot
    sink = replace(
        source, name="cmd_vel", qos=reliable, publishers=("twist_gate",), subscribers=("the robot",)
    )
    # A command that waited in a queue is not what the hand wants now.
    commands = node.observe(source, max_age=DRIVE_TIMEOUT)

    def now(velocity: Any) -> Any:
        if kind is TwistStamped and velocity is zero:
            velocity.header.stamp = node.get_clock().now().to_msg()
        return velocity

    zero: Any = kind()
    node.publish(sink, gated(commands, permission.observe(node), zero).map(now))


if __name__ == "__main__":
    service.run("twist_gate", wire)
