"""The engine controller: a latch that fails safe.

User story (ours): as a robot operator, I find the engines off unless I turned them on and have been seen ever
since, no matter which process dies.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import reactivex as rx
from reactivex import Observable
from reactivex.scheduler import ImmediateScheduler

from interfaces import service, topics
from interfaces.service import Rejected, ServiceNode, clocks, parameter
from interfaces.topics import CLOCK_TOLERANCE, OFF, ON

NEVER = datetime.min.replace(tzinfo=UTC)


class Tick(NamedTuple):
    """It is time to repeat the state."""

    at: datetime  # on the Rx clock, which is never set


class Presence(NamedTuple):
    """The operator was seen."""

    at: datetime  # of the arrival, on the Rx clock
    age: float  # of the stamp at arrival [s]


class Command(NamedTuple):
    """``turn_on`` or ``turn_off``."""

    at: datetime  # of the arrival, on the Rx clock
    age: float  # of the source time at arrival [s]
    name: str
    clocks: str  # which clock of another host is wrong; empty if none is


Event = Tick | Presence | Command


class Latch(NamedTuple):
    """The engines, when the operator was last seen, when the state was last repeated, and what to emit."""

    engines: str = OFF
    seen: datetime = NEVER
    repeated: datetime = NEVER
    says: tuple[str | Rejected, ...] = ()


@dataclass(frozen=True)
class Parameters:
    max_presence_age: float = parameter(1.0, (0.1, 1.0), "s", "`turn_on` needs a younger presence")
    presence_timeout: float = parameter(
        10.0, (1.0, 10.0), "s", "engines stay on only with a younger presence"
    )
    repeat: float = parameter(0.1, (0.02, 0.2), "s", "period at which the state is repeated")


DEFAULTS = Parameters()


def step(
    latch: Latch, event: Event, given: Parameters = DEFAULTS, drive_timeout: float = topics.DRIVE_TIMEOUT
) -> Latch:
    """Return the latch after an event.

    :param drive_timeout: the drive stops the engines if ``on`` is not repeated within this time [s].
    """
    unseen = (event.at - latch.seen).total_seconds()
    paused = (event.at - latch.repeated).total_seconds() > drive_timeout
    after = latch._replace(says=())
    if latch.engines == ON and (paused or unseen >= given.presence_timeout):
        after = after._replace(engines=OFF, repeated=event.at)

    def reject(topic: topics.Topic, reason: str) -> Latch:
        return after._replace(says=(Rejected(topic, reason),))

    match event:
        case Tick():
            after = after._replace(repeated=event.at)
        case Presence(age=age) if age < -CLOCK_TOLERANCE:
            reason = f"it is stamped by a clock that is {-age:.3f} s ahead of ours"
            after = reject(topics.OPERATOR_PRESENCE, reason)
        case Presence(age=age):
            after = after._replace(seen=max(latch.seen, event.at - timedelta(seconds=max(age, 0.0))))
        case Command(name=topics.TURN_ON, clocks=problem) if problem:
            after = reject(topics.ENGINES, f"turn_on refused: {problem}")
        case Command(age=age, name=topics.TURN_ON) if abs(age) >= given.max_presence_age:
            after = reject(topics.ENGINES, f"turn_on refused: {age:.3f} s old")
        case Command(name=topics.TURN_ON) if unseen >= given.max_presence_age:
            since = "yet" if latch.seen == NEVER else f"for {unseen:.3f} s"
            after = reject(topics.ENGINES, f"turn_on refused: no operator seen {since}")
        case Command(name=command):
            engines = ON if command == topics.TURN_ON else OFF
            if engines != after.engines:
                after = after._replace(engines=engines, repeated=event.at)
    is_news = (after.engines, after.repeated) != (latch.engines, latch.repeated)
    return after._replace(says=(*after.says, after.engines)) if is_news else after


def engine_state(
    commands: Observable[Command],
    presences: Observable[Presence],
    given: Parameters = DEFAULTS,
    drive_timeout: float = topics.DRIVE_TIMEOUT,
) -> Observable[str | Rejected]:
    """Emit ``on`` or ``off``, on every change and repeatedly, and each input that is rejected."""
    ticks = rx.timer(0.0, given.repeat).timestamp().map(lambda it: Tick(it.timestamp))
    events: Observable[Event] = rx.merge(commands, presences, ticks)
    latches = events.scan(lambda latch, event: step(latch, event, given, drive_timeout), Latch())
    at_once = ImmediateScheduler.singleton()
    return latches.flat_map(lambda latch: rx.from_iterable(latch.says, at_once))


def wire(node: ServiceNode) -> None:
    # The arrival before the age: a pause in between must make a presence older, not younger.
    commands = node.observe(topics.ENGINES, timestamped=True).timestamp()
    presences = node.observe(topics.OPERATOR_PRESENCE).timestamp()
    hosts = clocks.observe(node)
    states = engine_state(
        commands.map(
            lambda it: Command(it.timestamp, node.age(it.value.timestamp), it.value.value, hosts.objection())
        ),
        presences.map(lambda it: Presence(it.timestamp, node.age(it.value))),
        node.declare(Parameters),
    )
    node.publish(topics.ENGINES_STATE, states)


if __name__ == "__main__":
    service.run("engine_controller", wire)
