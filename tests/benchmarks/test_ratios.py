"""ReactiveNode beside plain callbacks on the same rclpy, interleaved: its cost must not grow unnoticed.

Absolute times depend on the machine, so only ratios are bounded, generously. `make bench` measures precisely.
"""

from __future__ import annotations

import statistics
import sys
from pathlib import Path

import pytest

from deploy.benchmarks import alternatives, measurement
from deploy.benchmarks.alternatives import Alternative
from deploy.benchmarks.measurement import Scenario
from deploy.commands.setup import system_rclpy

pytestmark = [pytest.mark.alone, pytest.mark.timeout(120)]

ROUNDS = 3
BOUNDS = {
    Scenario("pipeline", 1_000, 500.0): {"p50_ms": 1.8, "cpu_us": 1.8, "megabytes": 1.6},
    Scenario("flood", 8, 0.0): {"cpu_us": 2.0},
    Scenario("start", 8, 1000.0): {"seconds": 3.0},
}
"""Of ReactiveNode's figure divided by that of callbacks."""


def test_reactive_node_costs_little_more_than_callbacks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alternatives, "BENCH_PYTHON", Path(sys.executable))
    monkeypatch.setattr(alternatives, "SYSTEM_PYTHON", Path(sys.executable))
    pair = [Alternative(link, link, ros=bool(system_rclpy())) for link in ("reactive", "callbacks")]
    ratios: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for scenario, bounds in BOUNDS.items():
            ours, plain = (measurement.measure(it, scenario, warm_up=0.2, seconds=0.5) for it in pair)
            for name in bounds:
                figure = f"{scenario.key}.{name}"
                ratios.setdefault(figure, []).append(ours[figure] / plain[figure])
    medians = {figure: statistics.median(rounds) for figure, rounds in ratios.items()}
    print(medians)
    for scenario, bounds in BOUNDS.items():
        for name, bound in bounds.items():
            assert medians[f"{scenario.key}.{name}"] <= bound, f"{scenario.key}.{name} of {medians}"
