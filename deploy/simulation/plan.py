"""The shifts of a simulation, from a seed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from deploy.chaos.schedule import random_faults
from deploy.chaos.schedule_file import Shift
from deploy.simulation import people
from deploy.simulation.faults import FAULT_KINDS

LENGTH = 600.0  # s of a shift; each one begins with an arm that starts
QUIET = 15.0  # s at the end of a shift, in which the arm recovers from the last fault


def shifts(seed: str, hours: float, every: float, kinds: Sequence[str]) -> list[Shift]:
    """Return the shifts of so many hours, with a random fault in each interval of ``every`` [s]."""
    seconds = 3600.0 * hours
    number = math.ceil(seconds / LENGTH)
    return [
        shift(f"{seed} shift {index}", min(LENGTH, seconds - index * LENGTH), every, kinds)
        for index in range(number)
    ]


def shift(seed: str, length: float, every: float, kinds: Sequence[str]) -> Shift:
    """Return a shift with a random operator and random faults."""
    faults = random_faults(seed, length - QUIET, every=every, kinds=kinds, table=FAULT_KINDS)
    return Shift(seed, length, people.operator(seed, length), faults)
