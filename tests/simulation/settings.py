"""Random settings that a start accepts: does the judge find a violation where nothing is planted?

    .venv/bin/python -m tests.simulation.settings NUMBER MINUTES [SEED]

simulates each of so many settings for so many minutes, and prints each violation with its settings.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from deploy.supervision import interruption, parameter_file
from deploy.supervision.manifest import PAGE
from interfaces.service import UserError
from interfaces.service.parameters import Declaration
from tests.chaos.schedule_file import Experiment
from tests.simulation import plan
from tests.simulation.faults import FAULT_KINDS
from tests.simulation.workers import summaries

EVERY = 5.0  # s between two faults
FASTEST = 100.0  # Hz: a simulated switch of 10 kHz takes hours
UNUSED = ("use_sim_time", "pressed")  # these ask for another clock, and for no operator


def settings(seed: str) -> dict[str, Any]:
    """Return a parameter file that a start accepts."""
    rng = random.Random(f"settings {seed}")
    while True:
        document = {f"/{program}": {"ros__parameters": drawn} for program, drawn in _drawn(rng)}
        try:
            parameter_file.reaction_to(document, "/").check()
        except UserError:
            continue
        return document


def experiment(seed: str, length: float) -> Experiment:
    """Return an experiment of a length [s] with random settings, faults and attacks."""
    return plan.experiment(f"settings {seed}", length, EVERY, list(FAULT_KINDS), settings(seed))


def _drawn(rng: random.Random) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the parameters of each program, each of them with one chance in two."""
    for program, declared in parameter_file.declared().items():
        if program != PAGE:
            names = (name for name in declared if name not in UNUSED and rng.random() < 0.5)
            if drawn := {name: _value(rng, declared[name]) for name in names}:
                yield program, drawn


def _value(rng: random.Random, declaration: Declaration) -> Any:
    if isinstance(declaration.default, str):
        return f"node_{rng.randrange(10)}"
    if declaration.within is None:
        return rng.random() < 0.5
    least, most = declaration.within
    if isinstance(declaration.default, int):
        return rng.randint(int(least), int(most))
    if least <= 0.0:
        return rng.uniform(least, most)
    # A short time is as probable as a long one.
    return round(math.exp(rng.uniform(math.log(least), math.log(min(most, FASTEST)))), 3)


def main(arguments: Sequence[str]) -> int:
    """Print the violations, and how many settings had some; return the exit code."""
    interruption.install()
    parser = argparse.ArgumentParser(prog="python -m tests.simulation.settings", description=__doc__)
    parser.add_argument("number", type=int)
    parser.add_argument("minutes", type=float)
    parser.add_argument("seed", nargs="?", default=str(random.randrange(10**6)))
    given = parser.parse_args(arguments)
    print(f"Seed {given.seed}", flush=True)
    experiments = [experiment(f"{given.seed} {n}", 60.0 * given.minutes) for n in range(given.number)]
    try:
        return _judge(experiments)
    except interruption.Interrupted:
        print("Interrupted.")
        return 130


def _judge(experiments: Sequence[Experiment]) -> int:
    bad = 0
    for number, (each, summary) in enumerate(zip(experiments, summaries(experiments), strict=True), start=1):
        found = [(finding.promise, it) for finding in summary.total() for it in finding.evidence]
        bad += bool(found)
        if found:
            print(
                f"{each.seed}: {dict(each.parameters)}",
                *(f"  {promise} {it.time:.2f} s: {it.words}" for promise, it in found),
                sep="\n",
            )
        print(f"{number} of {len(experiments)}: {bad} with a violation", flush=True)
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
