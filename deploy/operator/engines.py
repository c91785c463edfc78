"""The engines as their controller reports them: what they do, and why."""

from __future__ import annotations

import math
from typing import NamedTuple

from interfaces.cause import Cause

WATCHDOG = "operator_watchdog"
RENEWED = 0.5  # s: the drive's 0.4 s and the way of the message


class Engines(NamedTuple):
    state: str | None = None
    reported: float = -math.inf
    """When the state was published."""
    cause: Cause | None = None
    explained: float = -math.inf
    """When the cause was published."""
    since: float | None = None
    """When the state of the cause began, since the origin of the scenario [s]."""

    def reports(self, state: str, now: float) -> Engines:
        """Note a state at a time [s]."""
        return self._replace(state=state, reported=now)

    def explains(self, cause: Cause, at: float, since: float | None = None) -> Engines:
        """Note a cause, when it was published [s], and since when its state lasts, if that is asked for."""
        return self._replace(cause=cause, explained=at, since=since)

    @property
    def known(self) -> Cause | None:
        """The cause of the state; it comes a little later."""
        return self.cause if self.cause and self.cause.state == self.state else None

    def words(self, now: float) -> str:
        """Return what they do, and why and since when [s]."""
        if now - self.reported > RENEWED:
            return "Engines: unknown"
        if not (cause := self.known):
            return f"Engines {self.state}"
        lasting = cause.since + now - self.explained
        return f"Engines {self.state}, {cause.words}, {max(lasting, 0.0):.0f} s ago"
