"""The shifts of a simulation, from a seed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from deploy.trials.chaos.schedule import random_faults
from deploy.trials.chaos.schedule_file import Shift
from deploy.trials.simulation import people
from deploy.trials.simulation.attacks import attacked
from deploy.trials.simulation.faults import FAULT_KINDS

LENGTH = 600.0  # s of a shift; each one begins with an arm that starts, the last one may be longer or shorter
QUIET = 15.0  # s at the end of a shift, in which the arm recovers from the last fault


def shifts(seed: str, hours: float, every: float, kinds: Sequence[str]) -> list[Shift]:
    """Return the shifts of so many hours, with a random fault in each interval of ``every`` [s]."""
    seconds = 3600.0 * hours
    # A rest of at most QUIET would have no fault, and perhaps no operator: it belongs to the shift before.
    number = max(1, math.ceil((seconds - QUIET) / LENGTH))
    lengths = [LENGTH] * (number - 1) + [seconds - (number - 1) * LENGTH]
    return [shift(f"{seed} shift {index}", length, every, kinds) for index, length in enumerate(lengths)]


def shift(seed: str, length: float, every: float, kinds: Sequence[str]) -> Shift:
    """Return a shift with a random operator and random faults; with all kinds of faults, attacks as well."""
    faults = random_faults(seed, length - QUIET, every=every, kinds=kinds, table=FAULT_KINDS)
    quiet = Shift(seed, length, people.operator(seed, length), faults)
    return attacked(quiet) if set(kinds) == set(FAULT_KINDS) else quiet
