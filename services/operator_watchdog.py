"""Whether the operator is alive.

User story (thesis 5.1): as a robot operator, I am able to turn off the engines when the operator becomes
incapacitated, that is, releases the dead man's switch 3 times for longer than 3 seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import reactivex as rx
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import Header, String

from interfaces import service
from interfaces.scenario.origin import Origin
from interfaces.service import ServiceNode, parameter
from interfaces.topics import (
    ALIVE,
    ENGINES,
    INCAPACITATED,
    MISSED,
    OPERATOR_ACTIVITY,
    OPERATOR_HEARTBEAT,
    OPERATOR_PRESENCE,
    TURN_OFF,
)
from reactive_node import stamps
from reactive_node.stamps import Timestamp

AT_ONCE = 0.1  # s after which a successor says whether it sees the operator
Heartbeat = Timestamp[Any]  # with its source time


def operator_activity(
    heartbeats: Observable[Heartbeat],
    *,
    received: Callable[[Heartbeat], None] = lambda heartbeat: None,
    alive: Callable[[Heartbeat], None] = lambda heartbeat: None,
    missed: Callable[[Exception], None] = lambda error: None,
    first: float = 0.5,  # [s] until the first sample, of which one is taken every so often
    sampling: float = 0.5,
    silence: float = 3.0,
    strikes: int = 3,
) -> Observable[Any]:
    """Emit nothing; end in an error at the last of ``strikes`` silences of ``silence`` [s] (Listing 5.7)."""
    return (
        heartbeats.do_action(received)  # Received signal from operator
        .sample(rx.timer(first, sampling))
        .timeout(silence)
        .do_action(alive, missed)  # Operator is alive; Not received signal from operator...
        .ignore_elements()
        .retry(strikes)
    )


def operator_incapacitated(
    heartbeats: Observable[Heartbeat],
    *,
    repeat: float = 0.5,
    incapacitated: Callable[[], None] = lambda: None,
    **activity: Any,
) -> Observable[str]:
    """
    Emit ``turn_off`` when the operator is incapacitated (Listing 5.8), and again every ``repeat`` [s].

    A heartbeat after the first ends that: "Operator is alive", and new strikes begin (Listing 5.7, above).
    """

    def watch(heartbeats: Observable[Heartbeat]) -> Observable[str]:
        back = heartbeats.do_action(activity.get("alive"))
        offs = rx.timer(0.0, repeat).map(lambda _: TURN_OFF)
        away = offs.publish(lambda it: it.take_until(back.skip_until(it)))

        def asleep(*_: Any) -> Observable[str]:
            incapacitated()
            return away

        return operator_activity(heartbeats, **activity).catch(asleep).repeat()

    return heartbeats.concat(rx.never()).publish(watch)  # a source that ends is silent for ever


@dataclass(frozen=True)
class Parameters:
    """What a user may set."""

    lifespan: float = parameter(0.5, (0.01, 10.0), "s", "an older heartbeat is no sign of life")
    sampling: float = parameter(0.5, (0.01, 10.0), "s", "the operator is reported alive at most this often")
    silence: float = parameter(3.0, (0.1, 60.0), "s", "a silence of this length is a strike")
    strikes: int = parameter(3, (1, 100), "", "the strike that turns the engines off")
    repeat: float = parameter(0.5, (0.05, 10.0), "s", "period at which `turn_off` is repeated")


def wire(node: ServiceNode) -> None:
    """Connect the recipe with its topics."""
    parameters = node.declare(Parameters)
    origin = Origin(node)
    presences: Subject[Heartbeat] = Subject()
    activity: Subject[str] = Subject()

    def missed(_: Exception) -> None:
        node.get_logger().warning("Not received signal from operator...")
        activity.on_next(MISSED)

    commands = operator_incapacitated(
        stamps.fresh(
            node.observe(OPERATOR_HEARTBEAT, timestamped=True),
            lifespan=parameters.lifespan,
            dropped=lambda why: node.drop(OPERATOR_HEARTBEAT.name, why),
        ),
        alive=presences.on_next,
        missed=missed,
        incapacitated=lambda: activity.on_next(INCAPACITATED),
        sampling=parameters.sampling,
        first=min(AT_ONCE, parameters.sampling) if origin.is_past else parameters.sampling,
        silence=parameters.silence,
        strikes=parameters.strikes,
        repeat=parameters.repeat,
    )
    node.publish(OPERATOR_PRESENCE, presences.map(lambda it: Header(stamp=stamps.to_message(it.timestamp))))
    conclusions = rx.merge(presences.map(lambda _: ALIVE), activity)
    node.publish(OPERATOR_ACTIVITY, conclusions.map(lambda conclusion: String(data=conclusion)))
    # Before a scenario begins nobody is expected: no silence counts yet.
    node.publish(ENGINES, origin.delay_subscription(commands).map(lambda command: String(data=command)))


def main() -> None:
    """Run the service."""
    service.run("operator_watchdog", wire)


if __name__ == "__main__":
    main()
