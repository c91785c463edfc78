"""ReactiveNode and the arm's services against plain callbacks on the same rclpy: regressions must show.

Absolute times depend on the machine, so only ratios of interleaved rounds are bounded, generously.
`make bench` measures precisely.
"""

from __future__ import annotations

import os
import statistics

import pytest

from deploy.supervision.rclpy_choice import GROUND
from tests.benchmarks import measurement
from tests.benchmarks.alternatives import Alternative
from tests.benchmarks.measurement import Scenario

pytestmark = [pytest.mark.alone, pytest.mark.timeout(120)]

ROUNDS = 3
BRIEF = {"warm_up": 0.2, "seconds": 0.5}
BOUNDS = {
    ("reactive", "callbacks"): {
        Scenario("pipeline", 1_000, 500.0, **BRIEF): {"p50_ms": 1.8, "cpu_us": 1.8, "megabytes": 1.6},
        Scenario("flood", 8, 0.0, **BRIEF): {"cpu_us": 2.0},
        Scenario("start", 8, 1000.0, **BRIEF): {"seconds": 3.0},
    },
    ("chain_services", "chain"): {
        Scenario("chain", 8, 500.0, **BRIEF): {"p50_ms": 1.8, "cpu_us": 1.6, "megabytes": 1.8},
    },
}
"""Of our figure divided by that of callbacks, by the links that are compared."""


@pytest.mark.parametrize("links", BOUNDS, ids=lambda links: links[0])
def test_reactive_costs_little_more_than_callbacks(links: tuple[str, str]) -> None:
    pair = [Alternative(link, link, ros=not os.environ.get(GROUND)) for link in links]
    ratios: dict[str, list[float]] = {}
    allowed: dict[str, float] = {}
    for _ in range(ROUNDS):
        for scenario, bounds in BOUNDS[links].items():
            ours, plain = (measurement.measure(it, scenario) for it in pair)
            for name, bound in bounds.items():
                figure = f"{scenario.key}.{name}"
                ratios.setdefault(figure, []).append(ours[figure] / plain[figure])
                allowed[figure] = bound
    medians = {figure: statistics.median(rounds) for figure, rounds in ratios.items()}
    print(medians)
    for figure, bound in allowed.items():
        assert medians[figure] <= bound, f"{figure} of {medians}"
