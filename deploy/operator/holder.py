"""The holder of the switch, as the hands themselves report it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from deploy.operator.hand import NAME as TERMINAL
from interfaces.limits import newest
from interfaces.topics import LONGEST_NAME

BEATING = 0.25  # s for which a heartbeat shows that the switch is held
REPORTED = 0.5  # s for which a node that has reported so is the one that holds it


class Holder(NamedTuple):
    heartbeat: float = -math.inf
    """When a heartbeat came [s]."""
    reported: Mapping[str, float] = {}
    """When each node has reported that its hand sends them [s]."""

    def beats(self, now: float) -> Holder:
        return self._replace(heartbeat=now)

    def reports(self, node: str, now: float) -> Holder:
        return self._replace(reported=newest({**self.reported, node[:LONGEST_NAME]: now}))

    def name(self, now: float, own: str = "") -> str | None:
        """Return the node that holds at a time [s]; empty if it reports no name, ``None`` if no hand holds.

        :param own: a node whose hand the caller knows better.
        """
        if now - self.heartbeat > BEATING:
            return None
        recent = {node: at for node, at in self.reported.items() if now - at <= REPORTED}
        others = {node: at for node, at in recent.items() if node != own}
        if not others:
            return None if recent else ""
        latest = max(others, key=others.__getitem__)
        return TERMINAL if latest.startswith(f"{TERMINAL}_") else latest

    def words(self, now: float) -> str:
        """Return whether somebody holds, and who [s]."""
        name = self.name(now)
        return "Released" if name is None else f"Held by {name}" if name else "Held"
