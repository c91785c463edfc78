"""The operator watchdog: turns the engines off when the operator is incapacitated.

User story (thesis 5.1): as a robot operator, I am able to turn off the engines when the operator becomes
incapacitated, that is, releases the dead man's switch 3 times for longer than 3 seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from interfaces import service, topics
from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.epoch import Epoch
from interfaces.topics import ALIVE, INCAPACITATED, MISSED, TURN_OFF
from reactive_node.stamps import Timestamp

READING = 0.1  # s at most between two looks for a heartbeat: thousands cost no more than those of a switch
DISCOVERY = 1.0  # s from the start of a successor until it surely hears the heartbeats


class Activity(NamedTuple):
    """A conclusion of the watchdog: ALIVE, with the source time of the heartbeat, MISSED or INCAPACITATED."""

    conclusion: str
    seen: datetime | None = None


@dataclass(frozen=True)
class Parameters:
    lifespan: float = parameter(0.5, (0.01, 10.0), "s", "an older heartbeat is no sign of life")
    sampling: float = parameter(0.5, (0.01, 10.0), "s", "the operator is reported alive at most this often")
    silence: float = parameter(3.0, (0.1, 60.0), "s", "a silence of this length is a strike")
    strikes: int = parameter(3, (1, 100), "", "the strike that turns the engines off")
    repeat: float = parameter(0.5, (0.05, 10.0), "s", "period at which `turn_off` is repeated")

    def __post_init__(self) -> None:
        """Raise UserError if each silence would be over before the operator is reported."""
        if self.sampling >= self.silence:
            raise UserError(f"sampling: must be less than silence, {self.silence:g} s, not {self.sampling:g}")

    @property
    def reading(self) -> float:
        """Time between two looks for a heartbeat [s]."""
        # Samples come equally long after a look, or the jitter would add to a silence.
        return self.sampling / math.ceil(self.sampling / min(READING, self.lifespan / 2))


DEFAULTS = Parameters()


def operator_activity(
    heartbeats: Observable[Timestamp[Any]], given: Parameters = DEFAULTS, *, resumes: bool = False
) -> Observable[Activity]:
    """Emit whether the operator is alive, missed, incapacitated (Listings 5.7 and 5.8).

    A return between the strikes does not reset them. The first heartbeat after the last strike is ALIVE at
    once and begins new strikes.

    :param resumes: whether the engines wait for a successor. It samples the first heartbeat at once. It
        counts no silence before that one until it has surely discovered the switch.
    """

    def watch(heartbeats: Observable[Timestamp[Any]]) -> Observable[Activity]:
        alive = heartbeats.map(lambda heartbeat: Activity(ALIVE, heartbeat.timestamp))
        conclusions = (
            alive.sample(rx.interval(given.sampling))
            .timeout(given.silence)
            .catch(lambda error, _: rx.throw(error).start_with(Activity(MISSED)))
            .retry(given.strikes)
            .catch(lambda error, _: alive.take(1).start_with(Activity(INCAPACITATED)))
            .repeat()
        )
        if not resumes:
            return conclusions
        first = alive.take(1).map(conclusions.start_with)
        return rx.amb(first, rx.timer(DISCOVERY).map(lambda _: conclusions)).merge_all()

    return heartbeats.concat(rx.never()).publish(watch)  # the end of a source is a silence


def engine_commands(activity: Observable[Activity], *, repeat: float = 0.5) -> Observable[str]:
    """Emit ``turn_off`` when the operator is incapacitated, and again every ``repeat`` [s] until ALIVE."""

    def commands(activity: Observable[Activity]) -> Observable[str]:
        away = activity.map(lambda it: it.conclusion == INCAPACITATED)
        again = away.switch_map(lambda is_away: rx.interval(repeat) if is_away else rx.never())
        return rx.merge(away.filter(bool), again).map(lambda _: TURN_OFF)

    return activity.publish(commands)


def wire(node: ServiceNode) -> None:
    given = node.declare(Parameters)
    epoch = Epoch(node)

    def warn(activity: Activity) -> None:
        node.get_logger().warning(f"operator {activity.conclusion}")

    heartbeats = node.observe_sampled(
        topics.OPERATOR_HEARTBEAT, given.reading, timestamped=True, max_age=given.lifespan
    )
    # Silences count from the origin of the scenario: before it, no operator is expected.
    activity = epoch.start(operator_activity(heartbeats, given, resumes=epoch.is_past)).share()
    presence = activity.filter(lambda it: it.conclusion == ALIVE)
    node.publish(topics.OPERATOR_PRESENCE, presence.map(lambda it: it.seen))
    node.publish(topics.OPERATOR_ACTIVITY, activity.map(lambda it: it.conclusion))
    node.publish(topics.ENGINES, engine_commands(activity, repeat=given.repeat))
    # A log message takes time, so it comes after the messages.
    activity.filter(lambda it: it.conclusion != ALIVE).subscribe(warn, scheduler=node.scheduler)


if __name__ == "__main__":
    service.run("operator_watchdog", wire)
