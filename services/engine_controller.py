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
from std_msgs.msg import String

from interfaces import service, topics
from interfaces.service import Rejected, ServiceNode, parameter
from interfaces.topics import OFF, ON
from reactive_node import stamps

CLOCK_TOLERANCE = 0.05  # s between the clocks of two hosts (deploy/SAFETY.md, A3)
NEVER = datetime.min.replace(tzinfo=UTC)


class Event(NamedTuple):
    """A command, a ``presence`` or a ``tick``."""

    name: str
    at: datetime  # of the arrival, on the Rx clock, which is never set
    age: float = 0.0  # of the stamp at arrival [s]


class State(NamedTuple):
    """The latch: the engines, when the operator was last seen, and when the state was last repeated."""

    engines: str = OFF
    seen: datetime = NEVER
    repeated: datetime = NEVER
    rejected: Rejected | None = None  # the last event


@dataclass(frozen=True)
class Parameters:
    """Parameters that a user may set."""

    max_presence_age: float = parameter(1.0, (0.1, 1.0), "s", "`turn_on` needs a younger presence")
    presence_timeout: float = parameter(
        10.0, (1.0, 10.0), "s", "engines stay on only with a younger presence"
    )
    repeat: float = parameter(0.1, (0.02, 0.2), "s", "period at which the state is repeated")


DEFAULTS = Parameters()


def step(
    state: State, event: Event, given: Parameters = DEFAULTS, drive_timeout: float = topics.DRIVE_TIMEOUT
) -> State:
    """
    Return the state after an event.

    :param drive_timeout: the drive stops the engines if ``on`` is not repeated within this time [s].
    """

    def reject(topic: topics.Topic, reason: str) -> State:
        return state._replace(rejected=Rejected(topic, reason))

    unseen = (event.at - state.seen).total_seconds()
    paused = (event.at - state.repeated).total_seconds() > drive_timeout
    if state.engines == ON and (paused or unseen >= given.presence_timeout):
        state = state._replace(engines=OFF, repeated=event.at)
    state = state._replace(rejected=None)
    match event.name, event.age:
        case "tick", _:
            return state._replace(repeated=event.at)
        case "presence", age if age < -CLOCK_TOLERANCE:
            reason = f"it is stamped by a clock that is {-age:.3f} s ahead of ours"
            return reject(topics.OPERATOR_PRESENCE, reason)
        case "presence", age:
            return state._replace(seen=max(state.seen, event.at - timedelta(seconds=max(age, 0.0))))
        case topics.TURN_ON, age if abs(age) >= given.max_presence_age:
            return reject(topics.ENGINES, f"turn_on refused: {age:.3f} s old")
        case topics.TURN_ON, _ if unseen >= given.max_presence_age:
            since = "yet" if state.seen == NEVER else f"for {unseen:.3f} s"
            return reject(topics.ENGINES, f"turn_on refused: no operator seen {since}")
        case command, _:
            engines = ON if command == topics.TURN_ON else OFF
            return state if engines == state.engines else state._replace(engines=engines, repeated=event.at)


def engine_state(
    commands: Observable[Event],
    presences: Observable[Event],
    given: Parameters = DEFAULTS,
    drive_timeout: float = topics.DRIVE_TIMEOUT,
) -> Observable[str | Rejected]:
    """Emit ``on`` or ``off``, on every change and repeatedly, and each input that is rejected."""
    ticks = rx.timer(0.0, given.repeat).timestamp().map(lambda it: Event("tick", it.timestamp))
    events = rx.merge(commands, presences, ticks)
    states = events.scan(lambda state, event: step(state, event, given, drive_timeout), State())

    def emitted(states: Observable[State]) -> Observable[str | Rejected]:
        rejections = states.map(lambda state: state.rejected).filter(bool)
        news = states.distinct_until_changed(lambda state: (state.engines, state.repeated))
        return rx.merge(rejections, news.map(lambda state: state.engines))

    return states.publish(emitted)


def wire(node: ServiceNode) -> None:
    """Connect the recipe with its topics."""
    # The arrival before the age: a pause in between must make a presence older, not younger.
    commands = node.observe(topics.ENGINES, timestamped=True).timestamp()
    presences = node.observe(topics.OPERATOR_PRESENCE).timestamp()
    states = engine_state(
        commands.map(lambda it: Event(it.value.value.data, it.timestamp, node.age(it.value.timestamp))),
        presences.map(
            lambda it: Event("presence", it.timestamp, node.age(stamps.from_message(it.value.stamp)))
        ),
        node.declare(Parameters),
    )
    node.publish(topics.ENGINES_STATE, states, lambda state: String(data=state))


if __name__ == "__main__":
    service.run("engine_controller", wire)
