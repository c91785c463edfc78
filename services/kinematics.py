"""The position of the effector.

User story (thesis 5.1): as a robot operator, I am able to observe the most recent position of the robot's
effector, a pair of its x and y coordinates.
"""

from __future__ import annotations

import reactivex as rx
from reactivex import Observable

from interfaces import service
from interfaces.robot_model import BASE, forward_kinematics, frame_id
from interfaces.service import ServiceNode
from interfaces.topics import EFFECTOR_POSITION, L1, L2, THETA1, THETA2, Position


def effector_position(
    l1: Observable[float], l2: Observable[float], theta1: Observable[float], theta2: Observable[float]
) -> Observable[tuple[float, float]]:
    """Emit the position on every change of any parameter, once all four are known (thesis 5.2.1)."""
    return rx.combine_latest(l1, l2, theta1, theta2).starmap(forward_kinematics)


def wire(node: ServiceNode) -> None:
    frame, clock = frame_id(BASE, node.get_namespace()), node.get_clock()
    l1, l2, theta1, theta2 = map(node.observe, (L1, L2, THETA1, THETA2))
    positions = effector_position(l1, l2, theta1, theta2)
    node.publish(
        EFFECTOR_POSITION, positions.starmap(lambda x, y: Position(clock.now().nanoseconds, x, y, frame))
    )


if __name__ == "__main__":
    service.run("kinematics", wire)
