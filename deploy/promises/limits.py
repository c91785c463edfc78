"""The limits of the promises, and the times after which services turn the engines off. All in seconds."""

from __future__ import annotations

from typing import NamedTuple

OFF_WITHIN = 10.5  # S1: from the last sign of life until the engines are off
STRIKE, STRIKES = 3.0, 3  # S2: silences after which the operator watchdog turns the engines off
PRESENCE_TIMEOUT = 10.0  # S2: without a presence, after which the engine controller turns them off
MAX_PRESENCE_AGE = 1.0  # S3: since the operator was seen, and since the command, when the engines turn on
MEDIAN, SLOWEST = 1.0, 2.0  # L1: from SIGKILL until the output flows again
GONE = 10.0  # L1: silence after any other fault
GAP = 0.25  # L2: between two messages of a stream
HUNG = 5.0  # L4: from a hang until the output flows again


class Durations(NamedTuple):
    title: str
    limits: tuple[float, ...]


DURATIONS = {
    "L1": Durations("Silence after SIGKILL [s]", (MEDIAN, SLOWEST)),
    "L4": Durations("Silence after a hang [s]", (HUNG,)),
}
"""The durations of the promises about time."""
