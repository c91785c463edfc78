"""The experiments of a simulation, from a seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from deploy.supervision import parameter_file
from tests.chaos.schedule import random_faults
from tests.chaos.schedule_file import Experiment
from tests.simulation import people
from tests.simulation.arm import NO_PARAMETERS
from tests.simulation.attacks import attacked
from tests.simulation.faults import FAULT_KINDS

LENGTH = 600.0  # s of an experiment, which begins with the start of the arm; the last one may differ
QUIET = 15.0  # s at the end of an experiment, in which the arm recovers from the last fault


def experiments(
    seed: str, hours: float, every: float, kinds: Sequence[str], parameters: Mapping[str, Any] = NO_PARAMETERS
) -> list[Experiment]:
    """Return experiments of some hours, with a random fault in each interval of ``every`` [s]."""
    seconds = 3600.0 * hours
    # A rest of at most QUIET would have no fault, and perhaps no operator: it belongs to the one before.
    number = max(1, math.ceil((seconds - QUIET) / LENGTH))
    lengths = [LENGTH] * (number - 1) + [seconds - (number - 1) * LENGTH]
    return [
        experiment(f"{seed} shift {index}", length, every, kinds, parameters)
        for index, length in enumerate(lengths)
    ]


def experiment(
    seed: str,
    length: float,
    every: float,
    kinds: Sequence[str],
    parameters: Mapping[str, Any] = NO_PARAMETERS,
) -> Experiment:
    """Return an experiment with a random operator, random faults and, if they are of all kinds, attacks."""
    faults = random_faults(seed, length - QUIET, every=every, kinds=kinds, table=FAULT_KINDS)
    scenario = people.operator(seed, length, parameter_file.reaction_to(parameters, "/"))
    quiet = Experiment(seed, length, scenario, faults, parameters)
    return attacked(quiet) if set(kinds) == set(FAULT_KINDS) else quiet
