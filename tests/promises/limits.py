"""The limits of the promises [s], except those that follow from the parameters of the arm."""

from __future__ import annotations

from typing import NamedTuple

MEDIAN, SLOWEST = 1.0, 2.0  # L1: from SIGKILL until the output flows again
GONE = 10.0  # L1: silence after any other fault
GAP = 0.25  # L2: between two messages of a stream
STREAM = 0.2  # L2: the usual time between two messages of a slowest stream: the rest is for delays
HUNG = 5.0  # L4: from a hang until the output flows again


class Durations(NamedTuple):
    title: str
    limits: tuple[float, ...]


DURATIONS = {
    "L1": Durations("Silence after SIGKILL [s]", (MEDIAN, SLOWEST)),
    "L4": Durations("Silence after a hang [s]", (HUNG,)),
}
"""The durations of the promises about time."""
