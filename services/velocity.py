"""How fast the effector moves.

User story (thesis 5.1): as a robot operator, I am able to observe the most recent speed of the robot's
effector: the Euclidean distance between the last two observed positions, divided by the time of the movement.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from geometry_msgs.msg import PointStamped
from reactivex import Observable
from std_msgs.msg import Float64

from interfaces import service
from interfaces.service import ServiceNode
from interfaces.topics import EFFECTOR_POSITION, EFFECTOR_SPEED


class Position(NamedTuple):
    """A position and the time of its emittance."""

    stamp: int  # [ns]
    x: float  # [m]
    y: float  # [m]


def speed(pair: tuple[Position, Position]) -> float:
    """Return distance over time [m/s] between two positions (thesis equation 5.2)."""
    before, after = pair
    return math.hypot(after.x - before.x, after.y - before.y) / ((after.stamp - before.stamp) / 1e9)


def effector_speed(
    positions: Observable[Position], dropped: Callable[[str], None] = lambda why: None
) -> Observable[float]:
    """
    Emit the speed between each two positions, if it is another one than before (thesis 5.2.2).

    Time is that of the stamps, so transport jitter, a pause and a burst after it change nothing. Two
    positions between which it does not advance have no speed: ``dropped`` is told why.
    """

    def advances(pair: tuple[Position, Position]) -> bool:
        before, after = pair
        if after.stamp > before.stamp:
            return True
        back = (before.stamp - after.stamp) / 1e9
        dropped(f"its time goes back by {back:g} s" if back else "its time stands still")
        return False

    return positions.pairwise().filter(advances).map(speed).distinct_until_changed()


def _position(message: PointStamped) -> Position:
    stamp = message.header.stamp
    return Position(stamp.sec * 10**9 + stamp.nanosec, message.point.x, message.point.y)


def wire(node: ServiceNode) -> None:
    """Connect the recipe with its topics."""
    positions = node.observe(EFFECTOR_POSITION).map(_position)
    speeds = effector_speed(positions, dropped=lambda why: node.drop(EFFECTOR_POSITION.name, why))
    node.publish(EFFECTOR_SPEED, speeds.map(lambda speed: Float64(data=speed)))


def main() -> None:
    """Run the service."""
    service.run("velocity", wire)


if __name__ == "__main__":
    main()
