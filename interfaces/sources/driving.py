"""How a joint follows the drive of its own host.

The drive publishes a time, not angles: both joints agree on it, and each remains what sets its joint.
"""

from __future__ import annotations

from reactivex import Observable

from interfaces.service import Rejected, ServiceNode, host
from interfaces.service.health import FASTEST
from interfaces.sources import playback
from interfaces.sources.timeline import Events, Sweep
from interfaces.topics import DRIVE_TIMEOUT, DRIVEN_TIME, DrivenTime


def followed(times: Observable[DrivenTime], source: str) -> Observable[float | Rejected]:
    """Emit the times of one drive, which never go back, and a rejection for each other one.

    After a partition, two drives may be heard, which stand at different times.

    :param source: the host of the drive that is followed.
    """

    def step(state: tuple[float, float | Rejected], time: DrivenTime) -> tuple[float, float | Rejected]:
        last, _ = state
        if time.source != source:
            rival = f"the drive of host {time.host[:64]} publishes it, too"
            return last, Rejected(DRIVEN_TIME, f"{rival}: the joint follows that of its own host")
        if time.seconds < last:
            return last, Rejected(DRIVEN_TIME, "it went back: the joint stands until it has caught up")
        return time.seconds, time.seconds

    begin: tuple[float, float | Rejected] = (0.0, 0.0)
    return times.scan(step, begin).map(lambda state: state[1])


def track(node: ServiceNode, timeline: Events[float] | Sweep) -> Observable[float]:
    """Return the values of a joint at the times of the drive of its own host; others are reported."""

    def is_followed(time: float | Rejected) -> bool:
        if isinstance(time, Rejected):
            node.reject(time)
            return False
        return True

    # A time that waited is not played: no joint may move after the drive has stopped.
    times = followed(node.observe(DRIVEN_TIME, max_age=DRIVE_TIMEOUT), host.identity())
    played = playback.driven(timeline, times.filter(is_followed))
    return node.stating({FASTEST: f"{timeline.fastest:.6g}"}, played)
