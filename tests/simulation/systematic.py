"""Systematic faults: each kind, in each service, at each moment in which the service decides something.

A service decides when it runs: because of a message, a timer, or another event. These moments are taken from
a day of the operator without faults. A case injects a fault just before such a moment, so it is a schedule
like any other.
"""

from __future__ import annotations

import itertools
import random
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rclpy_simulation import Process

from tests.chaos import testbed
from tests.chaos.schedule import AWAKE, DAY, FIRST_FAULT, SETTLE, PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.history import CONTROLLER, SWITCH, WATCHDOG
from tests.simulation import people
from tests.simulation.arm import NAMES, simulated_arm

FAULTS = {"kill": 0.0, "raise": 0.0, "stop": 15.0, "hang": 15.0, "slow": 1.0}
"""The kinds, with their durations [s]."""
JUST_BEFORE = 1e-8  # s
CRITICAL = (WATCHDOG, CONTROLLER, SWITCH)
"""The programs that stop the engines; two faults are injected into them."""
RELEASE = AWAKE - 1.0, DAY - SETTLE
"""The critical part of the day [s], around the release of the switch."""
SINGLES = 3  # cases with one fault, for each with two
SCENARIO = {
    **{key: value for key, value in testbed.SCENARIO.items() if key != "repeat"},
    **testbed.sources(people.RATE),
}
"""The operator's day of the chaos monkey, once."""

Point = tuple[float, str]
"""A moment of the scenario [s], and the program that runs then."""


def points(seed: str) -> list[Point]:
    """Return every moment of a day without faults in which a program runs."""
    found: dict[Point, None] = {}
    with (
        tempfile.TemporaryDirectory(prefix="reactive-arm-") as directory,
        simulated_arm(seed, Path(directory), SCENARIO) as arm,
    ):

        def note(process: Process) -> None:
            at = arm.simulation.now - arm.origin
            if process.name in NAMES and FIRST_FAULT <= at <= DAY - SETTLE:
                found[at, process.name] = None

        arm.simulation.listen(note)
        arm.simulation.run(arm.origin + DAY)
    return list(found)


def cases(seed: str) -> tuple[Sequence[Experiment], str]:
    """Return all cases and a title.

    Their order is random, three with one fault and then one with two, so every part covers the whole day.
    """
    every = points(seed)
    rng = random.Random(f"systematic {seed}")
    singles = [[_fault(point, kind)] for point in every for kind in FAULTS]
    critical = [point for point in every if point[1] in CRITICAL and RELEASE[0] <= point[0] <= RELEASE[1]]
    rng.shuffle(singles)
    number = len(singles) // SINGLES
    possible = len(critical) * (len(critical) - 1) // 2 * len(FAULTS) ** 2
    pairs = [_pair(rng, critical) for _ in range(min(number, possible))]
    mixed = itertools.chain.from_iterable(
        itertools.zip_longest(*(singles[first::SINGLES] for first in range(SINGLES)), pairs)
    )
    title = (
        f"Systematic faults, seed {seed}: {len(every)} moments, {len(singles)} cases with one fault; "
        f"around the release {len(critical)} moments, {possible} cases with two"
    )
    return [_experiment(seed, faults) for faults in mixed if faults is not None], title


def _fault(point: Point, kind: str) -> PlannedFault:
    at, program = point
    return PlannedFault(at - JUST_BEFORE, kind, program, FAULTS[kind])


def _pair(rng: random.Random, critical: Sequence[Point]) -> list[PlannedFault]:
    one, two = sorted(rng.sample(critical, 2))
    return [_fault(point, rng.choice(list(FAULTS))) for point in (one, two)]


def _experiment(seed: str, faults: list[PlannedFault]) -> Experiment:
    last = max(fault.at for fault in faults)
    # A fault that may delay the engines' stop is watched until they must be off, another until it is healed.
    length = DAY if last > AWAKE - 2 * SETTLE else last + SETTLE
    return Experiment(seed, length, SCENARIO, faults)
