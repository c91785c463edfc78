"""The twist of the effector, which is its velocity and its turn, at every time.

User story (ours): as a robot operator, I am able to see how fast the effector moves, and where to, whatever
the delays of messages are. As a developer, I am able to trust a single value.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from reactivex import Observable

from interfaces import service
from interfaces.robot_model import BASE, forward_kinematics, frame_id
from interfaces.service import ServiceNode, parameter
from interfaces.service.states import GAP, observe_state
from interfaces.topics import CONFIGURATION, EFFECTOR_TWIST, PlanarTwist
from reactive_node.signals import Answer, Signal, lift

PERIOD = 0.02  # s


def pose(l1: float, l2: float, theta1: float, theta2: float) -> tuple[float, float, float]:
    """Return the effector's position [m] and heading [rad]."""
    return *forward_kinematics(l1, l2, theta1, theta2), theta1 + theta2


def effector_twist(
    configuration: Iterable[Signal[float]], gap: float
) -> Observable[Answer[tuple[float, float, float]]]:
    """Emit x, y [m/s] and the turn [rad/s] at all multiples of 20 ms, from l1, l2, theta1 and theta2."""
    return lift(pose)(*configuration).derivative(over=gap).sample(PERIOD)


@dataclass(frozen=True)
class Parameters:
    gap: float = parameter(
        GAP,
        (0.01, 10.0),
        "s",
        "longest time between two samples of a movement; a velocity is its mean over it",
    )


def wire(node: ServiceNode) -> None:
    gap = node.declare(Parameters).gap
    frame = frame_id(BASE, node.get_namespace())

    def is_certain(answer: Answer[tuple[float, float, float]]) -> bool:
        if not answer.is_certain:
            node.health.count("uncertain")
        return answer.is_certain

    def twist(answer: Answer[tuple[float, float, float]]) -> PlanarTwist:
        x, y, turn = answer.value
        return PlanarTwist(answer.time, x, y, turn, frame)

    states = [observe_state(node, topic, gap) for topic in CONFIGURATION.values()]
    certain = effector_twist(states, gap).filter(is_certain)
    node.publish(EFFECTOR_TWIST, certain.map(twist), on_demand=True)  # most of the time nobody looks


if __name__ == "__main__":
    service.run("twist", wire)
