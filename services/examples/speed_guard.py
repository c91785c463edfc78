"""Turns the engines off when the effector is too fast."""

from dataclasses import dataclass

from reactivex import Observable

from interfaces import service, topics


def too_fast(speeds: Observable[float], limit: float) -> Observable[str]:
    """Emit `turn_off` when a speed is above the limit [m/s]."""
    excess = speeds.map(lambda speed: speed > limit).distinct_until_changed()
    return excess.filter(bool).map(lambda _: topics.TURN_OFF)


@dataclass(frozen=True)
class Parameters:
    limit: float = service.parameter(2.0, (0.0, 100.0), "m/s", "greatest speed allowed")


def wire(node: service.ServiceNode) -> None:
    speeds = node.observe(topics.EFFECTOR_VELOCITY).map(lambda velocity: velocity.speed)
    node.publish(topics.ENGINES, too_fast(speeds, node.declare(Parameters).limit))


if __name__ == "__main__":
    service.run("speed_guard", wire)
