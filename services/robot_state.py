"""The arm for tools that show robots in 3D: its joints, the transforms of its frames, and its description.

User story (ours): as a robot operator, I am able to see the arm move in RViz or Foxglove, without further
set-up.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import reactivex as rx
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from reactivex import Observable
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from interfaces import robot_model, service
from interfaces.robot_model import JOINTS, frame_id, urdf
from interfaces.service import ServiceNode, parameter
from interfaces.service.states import observe_state
from interfaces.topics import CONFIGURATION, CONTRACT, JOINT_STATES, L1, L2, ROBOT_DESCRIPTION, TF
from reactive_node.signals import UNKNOWN, Answer, Signal, lift
from reactive_node.stamps import time_message

DESCRIPTION_PERIOD = 1.0  # s: tools build the model again for each description


class Configuration(NamedTuple):
    """The lengths of the links [m] and the angles of the joints [rad]."""

    l1: float
    l2: float
    theta1: float
    theta2: float


def configurations(states: Iterable[Signal[float]], rate: float = 30.0) -> Observable[Answer[Configuration]]:
    """Emit the configuration at one common time, ``rate`` times a second, from l1, l2, theta1 and theta2.

    A held value counts, too: a dead source does not hide the arm. The stream is steady: a burst every 100 ms,
    as the slowest source sends, would make a pause of a busy machine so much longer.
    """
    configuration = lift(Configuration)(*states)
    return configuration.sample(1 / rate, steady=True).filter(lambda answer: answer.mark != UNKNOWN)


def lengths(l1: Observable[float], l2: Observable[float]) -> Observable[tuple[float, float]]:
    """Emit the lengths of both links [m] when they have changed, at most once a second."""
    return rx.combine_latest(l1, l2).distinct_until_changed().sample(DESCRIPTION_PERIOD)


@dataclass(frozen=True)
class Parameters:
    rate: float = parameter(30.0, (5.0, 100.0), "Hz", "how often `joint_states` and `/tf` come")


def wire(node: ServiceNode) -> None:
    namespace = node.get_namespace()

    def joint_state(stamp: Time, it: Configuration) -> JointState:
        return JointState(header=Header(stamp=stamp), name=list(JOINTS), position=[it.theta1, it.theta2])

    def transforms(stamp: Time, it: Configuration) -> Any:
        return TF.type(
            transforms=[
                TransformStamped(
                    header=Header(stamp=stamp, frame_id=frame_id(parent, namespace)),
                    child_frame_id=frame_id(child, namespace),
                    transform=transform,
                )
                for parent, child, transform in robot_model.transforms(*it)
            ]
        )

    states = [observe_state(node, topic) for topic in CONFIGURATION.values()]
    answers = configurations(states, node.declare(Parameters).rate)
    stamped = answers.map(lambda it: (time_message(it.time), it.value)).share()
    # Most of the time nobody looks.
    node.publish(JOINT_STATES, stamped.starmap(joint_state), on_demand=True)
    if TF in CONTRACT:
        node.publish(TF, stamped.starmap(transforms), on_demand=True)
    l1, l2 = map(node.observe, (L1, L2))
    node.publish(ROBOT_DESCRIPTION, lengths(l1, l2).starmap(lambda l1, l2: urdf(l1, l2, namespace)))


if __name__ == "__main__":
    service.run("robot_state", wire)
