"""Whether the engines run: a latch that fails safe.

User story (ours): as a robot operator, I find the engines off unless I was there and turned them on, and have
been seen ever since, whatever dies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

import reactivex as rx
from reactivex import Observable
from std_msgs.msg import String

from interfaces import service
from interfaces.service import ServiceNode, parameter
from interfaces.topics import (
    DRIVE_TIMEOUT,
    ENGINES,
    ENGINES_STATE,
    OFF,
    ON,
    OPERATOR_PRESENCE,
    TURN_OFF,
    TURN_ON,
)
from reactive_node import stamps
from reactive_node.stamps import Timestamp


def engine_state(
    commands: Observable[Timestamp[str]],
    presences: Observable[datetime],
    *,
    presence: float = 1.0,
    absence: float = 10.0,
    repeat: float = 0.1,
    drive: float = DRIVE_TIMEOUT,
    now: Callable[[], datetime] = stamps.now,
    refused: Callable[[str], None] = lambda why: None,
) -> Observable[str]:
    """
    Emit ``on`` or ``off``, on every change and every ``repeat`` [s]; the first is ``off``.

    :param commands: ``turn_on`` and ``turn_off``, with their source times.
    :param presences: the stamps of the operator's presences.
    :param presence: ``turn_on`` is obeyed if it and the last sight of the operator are younger [s].
    :param absence: when nobody was seen for so long [s], the engines turn off; not less than ``presence``.
    :param drive: the engines stop by themselves when ``on`` is not repeated for so long [s].
    :param now: the clock of source times and stamps.
    :param refused: is told why a ``turn_on`` is not obeyed, or a presence counts for nothing.
    """
    patience, hold = timedelta(seconds=absence), timedelta(seconds=drive)

    def obey(request: tuple[Timestamp[Timestamp[str]], datetime | None]) -> str | None:
        arrived, seen = request
        command = arrived.value
        if command.value == TURN_OFF:
            return OFF
        waited = abs(now() - command.timestamp).total_seconds()
        unseen = arrived.timestamp - seen if seen else timedelta.max
        if waited < presence and unseen < timedelta(seconds=presence):
            return ON
        since = f"for {unseen.total_seconds():.3f} s" if seen else "yet"
        why = f"no operator seen {since}" if waited < presence else f"{waited:.3f} s old"
        refused(f"{TURN_ON} refused: {why}")
        return None

    def is_late(renewal: tuple[tuple[Timestamp[int], Timestamp[int]], datetime | None]) -> bool:
        (before, beat), seen = renewal
        return beat.timestamp - before.timestamp > hold or bool(seen and beat.timestamp >= seen + patience)

    def repeated(seen: Observable[datetime]) -> Observable[str]:
        beats = rx.timer(0.0, repeat).timestamp().pairwise()
        late = beats.with_latest_from(seen.start_with(None)).map(is_late).share()
        obeyed = commands.timestamp().with_latest_from(seen.start_with(None)).map(obey).filter(bool)
        abandoned = seen.switch_map(lambda at: rx.timer(at + patience)).map(lambda _: OFF)
        # While this process was paused, the engines have stopped, or should have: `on` would start them.
        stopped = late.filter(bool).map(lambda _: OFF)
        states = rx.merge(stopped, obeyed, abandoned).start_with(OFF).distinct_until_changed().share()
        renewals = late.with_latest_from(states).filter(lambda it: it != (True, ON))
        return rx.merge(renewals.map(lambda it: it[1]), states)

    return stamps.latest(presences, now=now, dropped=lambda why: refused(f"presence: {why}")).publish(
        repeated
    )


@dataclass(frozen=True)
class Parameters:
    """What a user may set."""

    presence: float = parameter(1.0, (0.1, 1.0), "s", "`turn_on` needs an operator seen within this time")
    absence: float = parameter(10.0, (1.0, 10.0), "s", "engines turn off after this time without operator")
    repeat: float = parameter(0.1, (0.02, 0.2), "s", "period at which the state is repeated")


def wire(node: ServiceNode) -> None:
    """Connect the recipe with its topics."""
    parameters = node.declare(Parameters)
    states = engine_state(
        node.observe(ENGINES, timestamped=True).map(lambda item: Timestamp(item.value.data, item.timestamp)),
        node.observe(OPERATOR_PRESENCE).map(lambda header: stamps.from_message(header.stamp)),
        presence=parameters.presence,
        absence=parameters.absence,
        repeat=parameters.repeat,
        refused=lambda why: node.remark(ENGINES.name, why),
    )
    node.publish(ENGINES_STATE, states.map(lambda state: String(data=state)))


def main() -> None:
    """Run the service."""
    service.run("engine_controller", wire)


if __name__ == "__main__":
    main()
