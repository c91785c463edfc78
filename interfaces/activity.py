"""The activity of the operator: what the watchdog concludes, when it looks, and how its successor begins."""

from __future__ import annotations

import math
from datetime import datetime
from typing import NamedTuple

import reactivex as rx
from reactivex import Observable

READING = 0.1  # s at most between two looks for a heartbeat: thousands cost no more than those of a switch
DISCOVERY = 1.0  # s from the start of a successor until it surely hears the heartbeats


class Activity(NamedTuple):
    """A conclusion of the watchdog: ALIVE, with the source time of the heartbeat, MISSED or INCAPACITATED."""

    conclusion: str
    seen: datetime | None = None


def reading_period(sampling: float, lifespan: float) -> float:
    """Return the time between two looks for a heartbeat [s].

    Samples come equally long after a look, or the jitter would add to a silence.
    """
    return sampling / math.ceil(sampling / min(READING, lifespan / 2))


def resume(alive: Observable[Activity], conclusions: Observable[Activity]) -> Observable[Activity]:
    """Emit the conclusions of a successor, for which the engines wait.

    It concludes at once from the first heartbeat. It counts no silence before that one until it has surely
    discovered the switch.
    """
    first = alive.take(1).map(conclusions.start_with)
    return rx.amb(first, rx.timer(DISCOVERY).map(lambda _: conclusions)).merge_all()
