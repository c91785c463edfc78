"""A pytest plugin with the fixture ``simulation``.

Load it with ``pytest_plugins = ["rclpy_simulation.testing"]`` in ``conftest.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from rclpy_simulation.simulation import Simulation

_MARKER = "simulation(seed=0, network=None): the seed and the network of the fixture of that name"


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", _MARKER)


@pytest.fixture
def simulation(request: pytest.FixtureRequest) -> Iterator[Simulation]:
    """A simulation; ``@pytest.mark.simulation(seed=7, network=Network(loss=0.1))`` chooses its arguments."""
    marker = request.node.get_closest_marker("simulation")
    with Simulation(*(marker.args if marker else ()), **(marker.kwargs if marker else {})) as simulation:
        yield simulation


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Any:
    """Show the output of the simulated processes with a failure."""
    report = yield
    simulation = getattr(item, "funcargs", {}).get("simulation")
    if report.when == "call" and report.failed and isinstance(simulation, Simulation):
        for end in simulation.ends:
            title = f"Output of {end.name}, pid {end.pid}, exit code {end.exit_code}"
            report.sections.append((title, end.output))
        for process in simulation.processes:
            report.sections.append((f"Output of {process.name}, pid {process.pid}", process.output.text))
    return report
