"""The operator watchdog: turns the engines off when the operator is incapacitated.

User story (thesis 5.1): as a robot operator, I am able to turn off the engines when the operator becomes
incapacitated, that is, releases the dead man's switch 3 times for longer than 3 seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import reactivex as rx
from reactivex import Observable

from interfaces import service, topics
from interfaces.activity import Activity, reading_period, resume
from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.epoch import Epoch
from interfaces.topics import ALIVE, INCAPACITATED, MISSED, TURN_OFF
from reactive_node.stamps import Timestamp


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
        return reading_period(self.sampling, self.lifespan)


DEFAULTS = Parameters()


def operator_activity(
    heartbeats: Observable[Timestamp[Any]], parameters: Parameters = DEFAULTS, *, resumes: bool = False
) -> Observable[Activity]:
    """Emit whether the operator is alive, missed, incapacitated (Listings 5.7 and 5.8).

    A return between the strikes does not reset them. The first heartbeat after the last strike is ALIVE at
    once and begins new strikes. A successor ``resumes``: the engines wait for it.
    """

    def watch(heartbeats: Observable[Timestamp[Any]]) -> Observable[Activity]:
        alive = heartbeats.map(lambda heartbeat: Activity(ALIVE, heartbeat.timestamp))
        conclusions = (
            alive.sample(rx.interval(parameters.sampling))
            .timeout(parameters.silence)
            .catch(lambda error, _: rx.throw(error).start_with(Activity(MISSED)))
            .retry(parameters.strikes)
            .catch(lambda error, _: alive.take(1).start_with(Activity(INCAPACITATED)))
            .repeat()
        )
        return resume(alive, conclusions) if resumes else conclusions

    return heartbeats.concat(rx.never()).publish(watch)  # the end of a source is a silence


def engine_commands(activity: Observable[Activity], *, repeat: float = 0.5) -> Observable[str]:
    """Emit ``turn_off`` when the operator is incapacitated, and again every ``repeat`` [s] until ALIVE."""

    def commands(activity: Observable[Activity]) -> Observable[str]:
        away = activity.map(lambda it: it.conclusion == INCAPACITATED)
        again = away.switch_map(lambda is_away: rx.interval(repeat) if is_away else rx.never())
        return rx.merge(away.filter(bool), again).map(lambda _: TURN_OFF)

    return activity.publish(commands)


def wire(node: ServiceNode) -> None:
    parameters = node.declare(Parameters)
    epoch = Epoch(node)
    heartbeats = node.observe_sampled(
        topics.OPERATOR_HEARTBEAT, parameters.reading, timestamped=True, max_age=parameters.lifespan
    )
    # Silences count from the origin of the scenario: before it, no operator is expected.
    activity = epoch.start(operator_activity(heartbeats, parameters, resumes=epoch.is_past)).share()
    presence = activity.filter(lambda it: it.conclusion == ALIVE)
    node.publish(topics.OPERATOR_PRESENCE, presence.map(lambda it: it.seen))
    conclusions = activity.map(lambda it: it.conclusion)
    node.publish(topics.OPERATOR_ACTIVITY, conclusions)
    node.publish(topics.ENGINES, engine_commands(activity, repeat=parameters.repeat))
    # A log message takes time, so it comes after the messages.
    losses = conclusions.filter(lambda it: it != ALIVE)
    losses.subscribe(lambda it: node.get_logger().warning(f"operator {it}"), scheduler=node.scheduler)


if __name__ == "__main__":
    service.run("operator_watchdog", wire)
