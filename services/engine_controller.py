"""The engine controller: a latch that fails safe.

User story (ours): as a robot operator, I find the engines off unless I turned them on and have been seen ever
since, no matter which process dies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import reactivex as rx
from reactivex import Observable
from reactivex.scheduler import ImmediateScheduler

from interfaces import explanation, service, topics
from interfaces.latch import Command, Comparison, Event, Latch, Presence, Tick, Turn
from interfaces.service import Rejected, ServiceNode, clocks, parameter
from interfaces.topics import CLOCK_TOLERANCE, DRIVE_TIMEOUT, OFF, ON


@dataclass(frozen=True)
class Parameters:
    max_presence_age: float = parameter(1.0, (0.1, 1.0), "s", "`turn_on` needs a younger presence")
    presence_timeout: float = parameter(10.0, (1.0, 10.0), "s", "engines that are on need a younger presence")
    repeat: float = parameter(0.1, (0.02, 0.2), "s", "period at which the state is repeated")


DEFAULTS = Parameters()


def step(latch: Latch, event: Event, parameters: Parameters = DEFAULTS) -> Latch:
    """Return the latch after an event. A drive stops the engines unless ``on`` is repeated in time."""
    unseen, paused = latch.ages(event.at)
    after = latch._replace(outputs=())
    if latch.engines == ON and (paused > DRIVE_TIMEOUT or unseen >= parameters.presence_timeout):
        after = after._replace(engines=OFF, repeated=event.at)
    match event:
        case Tick():
            after = after._replace(repeated=event.at)
        case Presence(age=age) if age < -CLOCK_TOLERANCE:
            ahead = f"it is stamped by a clock that is {-age:.3f} s ahead of ours"
            after = after.reject(topics.OPERATOR_PRESENCE, ahead)
        case Presence():
            after = after._replace(seen=max(latch.seen, event.seen))
        case Comparison(refusal=refusal):
            after = after._replace(refusal=refusal)
        case Command(name=topics.TURN_ON) if refusal := latch.why_refused(event, parameters.max_presence_age):
            after = after.reject(topics.ENGINES, refusal)
        case Command(name=command):
            engines = ON if command == topics.TURN_ON else OFF
            if engines != after.engines:
                after = after._replace(engines=engines, repeated=event.at)
    is_news = (after.engines, after.repeated) != (latch.engines, latch.repeated)
    return after._replace(outputs=(*after.outputs, after.engines)) if is_news else after


def turns(
    commands: Observable[Command],
    presences: Observable[Presence],
    parameters: Parameters = DEFAULTS,
    comparisons: Observable[Comparison] | None = None,
) -> Observable[Turn]:
    """Emit each turn of the latch, which ticks. The first comparison of clocks counts before any command."""
    ticks = rx.timer(0.0, parameters.repeat).timestamp().map(lambda it: Tick(it.timestamp))
    events: Observable[Event] = rx.merge(comparisons or rx.empty(), commands, presences, ticks)
    return events.scan(
        lambda last, event: Turn(event, last.after, step(last.after, event, parameters)), Turn()
    )


def engine_state(turns: Observable[Turn]) -> Observable[str | Rejected]:
    """Emit ``on`` or ``off``, on every change and repeatedly, and each input that is rejected."""
    at_once = ImmediateScheduler.singleton()
    return turns.flat_map(lambda turn: rx.from_iterable(turn.after.outputs, at_once))


def wire(node: ServiceNode) -> None:
    # The arrival before the age: a pause in between must make a presence older, not younger.
    commands = node.observe(topics.ENGINES, timestamped=True).timestamp()
    presences = node.observe(topics.OPERATOR_PRESENCE).timestamp()
    comparisons = clocks.observe(node).timestamp()

    def command(item: Any) -> Command:
        arrival, (name, sent) = item.timestamp, (item.value.value, item.value.timestamp)
        return Command(arrival, node.age(sent), name, sent)

    latched = turns(
        commands.map(command),
        presences.map(lambda it: Presence(it.timestamp, node.age(it.value))),
        node.declare(Parameters),
        comparisons=comparisons.map(lambda it: Comparison(it.timestamp, it.value)),
    ).share()
    node.publish(topics.ENGINES_STATE, engine_state(latched))
    explanation.publish_causes(node, latched)


if __name__ == "__main__":
    service.run("engine_controller", wire)
