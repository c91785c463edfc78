"""How many silences the operator has left, from what the operator watchdog concludes."""

from __future__ import annotations

import math
from typing import NamedTuple

from reactivex import Observable

from interfaces import topics
from interfaces.topics import ALIVE, INCAPACITATED, MISSED
from reactive_node import ReactiveNode


class Operator(NamedTuple):
    seen: float = -math.inf
    """When the operator was seen [s]."""
    activity: str | None = None
    strikes_left: int | None = None
    concluded: float = -math.inf
    """When the watchdog has reported this: the next silence counts from then on [s]."""

    def concludes(self, activity: str, strikes: int, now: float) -> Operator:
        """Note a conclusion. ``strikes`` is the strike that turns the engines off."""
        left = self.strikes_left
        if activity == MISSED and left is not None:
            left = max(0, left - 1)
        elif activity == INCAPACITATED:
            left = 0
        elif activity == ALIVE and self.activity == INCAPACITATED:
            left = strikes
        return Operator(self.seen, activity, left, now)

    def begins_again(self, strikes: int | None) -> Operator:
        """Note a watchdog that appears: a new one begins to count, an older one has counted already."""
        return Operator(self.seen, None, strikes)


def new_watchdogs(node: ReactiveNode, *, first_is_new: bool) -> Observable[bool]:
    """Emit for each operator watchdog that appears whether it is new; the first may be older than us."""
    topic = topics.OPERATOR_ACTIVITY
    matches = node.create_event_observable(topic.type, topic.name, topic.qos, "matched")
    appeared = matches.filter(lambda it: it.current_count_change > 0)
    return appeared.map_indexed(lambda _, index: index > 0 or first_is_new)
