"""The speed of the effector.

User story (thesis 5.1): as a robot operator, I am able to observe the most recent speed of the robot's
effector: the Euclidean distance between the last two observed positions, divided by the time of the movement.
"""

from __future__ import annotations

import math

from reactivex import Observable

from interfaces import service
from interfaces.service import Rejected, ServiceNode
from interfaces.topics import EFFECTOR_POSITION, EFFECTOR_SPEED, Position


def speed(pair: tuple[Position, Position]) -> float | Rejected:
    """Return distance over time [m/s] between two positions (thesis equation 5.2), if time advances."""
    before, after = pair
    seconds = (after.stamp - before.stamp) / 1e9
    if seconds <= 0:
        reason = f"its time goes back by {-seconds:g} s" if seconds else "its time stands still"
        return Rejected(EFFECTOR_POSITION, reason)
    return math.hypot(after.x - before.x, after.y - before.y) / seconds


def effector_speed(positions: Observable[Position]) -> Observable[float | Rejected]:
    """Emit the speed between each two positions, if it differs from the one before (thesis 5.2.2).

    Time is that of the stamps: transport jitter, a pause and the burst after it change no speed.
    """
    return positions.pairwise().map(speed).distinct_until_changed()


def wire(node: ServiceNode) -> None:
    node.publish(EFFECTOR_SPEED, effector_speed(node.observe(EFFECTOR_POSITION)))


if __name__ == "__main__":
    service.run("velocity", wire)
