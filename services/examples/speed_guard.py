"""Turns the engines off when the effector is too fast."""

from dataclasses import dataclass

import reactivex as rx
from reactivex import Observable

from interfaces import service, topics


def too_fast(speeds: Observable[float], engines: Observable[str], limit: float) -> Observable[str]:
    """Emit `turn_off` when a speed is above the limit [m/s] while the engines are on.

    So a `turn_on` during the excess turns them on for a moment only.
    """
    excess = speeds.map(lambda speed: speed > limit)
    dangers = rx.combine_latest(excess, engines).filter(lambda now: now == (True, topics.ON))
    return dangers.map(lambda _: topics.TURN_OFF)


@dataclass(frozen=True)
class Parameters:
    limit: float = service.parameter(2.0, (0.0, 100.0), "m/s", "greatest speed allowed")


def wire(node: service.ServiceNode) -> None:
    speeds = node.observe(topics.EFFECTOR_TWIST).map(lambda twist: twist.speed)
    engines = node.observe(topics.ENGINES_STATE)
    node.publish(topics.ENGINES, too_fast(speeds, engines, node.declare(Parameters).limit))


if __name__ == "__main__":
    service.run("speed_guard", wire)
