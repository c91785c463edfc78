"""`make bench`: compare this system with its alternatives, on the same work in one interleaved run.

A source publishes items, a middle process maps and publishes them again, a sink receives them. Then a source
floods a sink, and a source starts while a sink waits. `chain` compares the arm's kinematics and velocity, and
its operator watchdog, with the same in plain callbacks.

Each round measures all alternatives in a random order, so a busy machine affects all alike. CPU time is that
of whole processes. What cannot be measured here is named with the reason.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from deploy.supervision import interruption
from deploy.supervision.processes import run_directory
from tests.benchmarks import scale, signals
from tests.benchmarks.alternatives import ALTERNATIVES, CHAINS, Alternative
from tests.benchmarks.measurement import (
    CHAIN_SCENARIOS,
    SCENARIOS,
    WATCHDOG_SCENARIOS,
    MeasurementFailed,
    Scenario,
    measure,
)
from tests.benchmarks.table import chain_tables, tables

COMPARISON, CHAIN, SCALE, SIGNALS = "comparison", "chain", "scale", "signals"
TABLES: dict[str, Callable[[Any], str]] = {
    COMPARISON: tables,
    CHAIN: chain_tables,
    SCALE: scale.tables,
    SIGNALS: signals.table,
}
WORK: dict[str, tuple[Sequence[Alternative], Sequence[Scenario]]] = {
    COMPARISON: (ALTERNATIVES, SCENARIOS),
    CHAIN: (CHAINS, CHAIN_SCENARIOS),
}


def present(alternatives: Iterable[Alternative]) -> list[Alternative]:
    """Return the alternatives that can be measured; print the others with the reason, one line each."""
    found = []
    for each in alternatives:
        interruption.check()
        if reason := each.missing():
            print(f"absent: {each.title}: {reason}", flush=True)
        else:
            found.append(each)
    return found


def compare(
    alternatives: Sequence[Alternative], scenarios: Sequence[Scenario], rounds: int
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the figures of each measurement with the alternative's title; a round measures all of them.

    Each round and scenario has its own random order: neither a machine that becomes slower, nor what was
    measured just before, favours one.
    """
    began = time.monotonic()
    for number in range(1, rounds + 1):
        for scenario in scenarios:
            print(f"round {number} of {rounds}, {scenario.key}, {time.monotonic() - began:.0f} s", flush=True)
            for each in random.sample(alternatives, len(alternatives)):
                try:
                    yield each.title, measure(each, scenario)
                except MeasurementFailed as error:
                    print(f"no figures: {each.title}, {scenario.key}: {error}", flush=True)


def machine() -> str:
    """Return when and where this runs, in one line."""
    models = [
        line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")
    ]
    model = models[0].partition(":")[2].strip() if models else platform.machine()
    cores = len(os.sched_getaffinity(0))
    load = os.getloadavg()[0]
    return (
        f"{time.strftime('%Y-%m-%d')}, {cores} cores of {model}, Linux {platform.release()}, "
        f"Python {platform.python_version()}, load {load:.1f} at the start"
    )


def versions() -> str:
    """Return the versions of the libraries below the ground of Cyclone DDS and ReactiveNode."""
    found = {each.name: each.version for each in metadata.distributions()}
    return ", ".join(f"{name} {found[name]}" for name in ("cyclonedds", "reactivex") if name in found)


def main(arguments: Sequence[str]) -> int:
    """Run the command line; return the exit code."""
    usage = 'make bench [BENCH="[KIND] [OPTION ...]"]'
    parser = argparse.ArgumentParser(prog="make bench", usage=usage, description=__doc__)
    kinds = {
        COMPARISON: "this system and its alternatives (the default)",
        CHAIN: "the arm's own services and the same in plain callbacks",
        SCALE: "many arms, many subscribers",
        SIGNALS: "what signals cost, and how exact the speed of a real arm is",
    }
    shown = "; ".join(f"{name}: {meaning}" for name, meaning in kinds.items())
    parser.add_argument("kind", nargs="?", choices=kinds, default=COMPARISON, metavar="KIND", help=shown)
    parser.add_argument("--rounds", type=int, default=3, help="how many times to compare (3)")
    options = parser.parse_args(arguments)
    if options.rounds < 1:
        parser.error("--rounds must be at least 1")
    interruption.install()
    results: dict[str, Any] = {}
    code = 0
    try:
        if options.kind == SCALE:
            collect_scale(results)
        elif options.kind == SIGNALS:
            print(machine(), flush=True)
            results |= {name: row for name, *row in signals.measure()}
        else:
            _compare(results, options.kind, options.rounds)
    except interruption.Interrupted:
        print("Interrupted. So far:", flush=True)
        code = 130
    if any(results.values()):
        interruption.ignore()
        print(f"\n{TABLES[options.kind](results)}\n")
        _write(options.kind, results)
    return code


def _compare(results: dict[str, Any], kind: str, rounds: int) -> None:
    alternatives, scenarios = WORK[kind]
    found = present(alternatives)
    if kind == CHAIN and any(each.build for each in found):  # the source of the heartbeats is in C
        scenarios = (*scenarios, *WATCHDOG_SCENARIOS)
    print(f"{machine()}; {versions()}", flush=True)
    results |= {each.title: {} for each in found}
    for title, figures in compare(found, scenarios, rounds):
        for name, value in figures.items():
            results[title].setdefault(name, []).append(value)


def collect_scale(results: dict[str, Any]) -> None:
    """Collect the figures of each number of arms and subscribers, by kind."""
    print(machine(), flush=True)
    for kind, number, figures in scale.measure():
        results.setdefault(kind, {})[number] = {name: [value] for name, value in figures.items()}


def _write(kind: str, results: dict[str, Any]) -> None:
    directory = run_directory() / "bench"
    directory.mkdir(parents=True, exist_ok=True)
    file = directory / f"{kind}.json"
    file.write_text(json.dumps(results, indent=1))
    print(f"Figures: {file}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
