"""The latch of the engines, and the events that turn it: what the engine controller decides by."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import NamedTuple

from interfaces.permission import NEVER
from interfaces.service import Rejected
from interfaces.topics import OFF, Topic

REFUSED = "turn_on refused: "
"""How the reason of a rejected ``turn_on`` begins."""


class Tick(NamedTuple):
    """It is time to repeat the state."""

    at: datetime  # on the Rx clock, which is never set


class Presence(NamedTuple):
    """The operator was seen."""

    at: datetime  # of the arrival, on the Rx clock
    age: float  # of the stamp at arrival [s]

    @property
    def seen(self) -> datetime:
        """When the operator was seen, on the Rx clock: not later than the arrival."""
        return self.at - timedelta(seconds=max(self.age, 0.0))


class Command(NamedTuple):
    """``turn_on`` or ``turn_off``."""

    at: datetime  # of the arrival, on the Rx clock
    age: float  # of the source time at arrival [s]
    name: str
    sent: datetime = NEVER  # the source time


class Comparison(NamedTuple):
    """The clocks of the hosts were compared."""

    at: datetime  # on the Rx clock
    refusal: str  # why ``turn_on`` is refused; empty if it is not


Event = Tick | Presence | Command | Comparison


class Latch(NamedTuple):
    """The engines, when the operator was last seen, when the state was last repeated, what to emit, and why
    ``turn_on`` is refused by the clocks of the hosts.
    """

    engines: str = OFF
    seen: datetime = NEVER
    repeated: datetime = NEVER
    outputs: tuple[str | Rejected, ...] = ()
    refusal: str = ""

    def ages(self, now: datetime) -> tuple[float, float]:
        """Return how long ago the operator was seen, and the state repeated [s]."""
        return (now - self.seen).total_seconds(), (now - self.repeated).total_seconds()

    def reject(self, topic: Topic, reason: str) -> Latch:
        """Return it with a rejected event as its output."""
        return self._replace(outputs=(Rejected(topic, reason),))

    def why_refused(self, command: Command, max_age: float) -> str:
        """Return why ``turn_on`` is refused; empty if it is not.

        :param max_age: of the command, and of the last sign of the operator [s].
        """
        unseen, _ = self.ages(command.at)
        if self.refusal:
            return f"{REFUSED}{self.refusal}"
        if abs(command.age) >= max_age:
            return f"{REFUSED}{command.age:.3f} s old"
        if unseen >= max_age:
            return f"{REFUSED}no operator seen {'yet' if self.seen == NEVER else f'for {unseen:.3f} s'}"
        return ""


class Turn(NamedTuple):
    """An event, and the latch before and after it."""

    event: Event = Tick(NEVER)
    before: Latch = Latch()
    after: Latch = Latch()
