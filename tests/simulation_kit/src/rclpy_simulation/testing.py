"""A pytest plugin with the fixture ``simulation``.

Load it with ``pytest_plugins = ["rclpy_simulation.testing"]`` in ``conftest.py``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from rclpy_simulation.faults import Fault, minimal
from rclpy_simulation.host import BOOT, MIDNIGHT
from rclpy_simulation.simulation import Simulation
from rclpy_simulation.timeline import Timeline

_MARKER = (
    "simulation(seed=0, network=None, faults={}, seeds=()): the arguments of the fixture of that name,"
    " and seeds with which the test runs one after the other, until it fails"
)
_GIVEN = pytest.StashKey[dict[str, Any]]()
"""What replaces the arguments of the marker in one of several runs."""
_TIMELINE = pytest.StashKey[Timeline]()


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", _MARKER)


@pytest.fixture
def simulation(request: pytest.FixtureRequest) -> Iterator[Simulation]:
    """A simulation; ``@pytest.mark.simulation(seed=7, network=Network(loss=0.1))`` chooses its arguments."""
    marker = request.node.get_closest_marker("simulation")
    options = (marker.kwargs if marker else {}) | request.node.stash.get(_GIVEN, {})
    options.pop("seeds", None)
    faults, record = options.pop("faults", None), options.pop("record", None)
    with (
        Simulation(*(marker.args if marker else ()), **options) as simulation,
        recorded(simulation, record) if record else nullcontext(),
    ):
        request.node.stash[_TIMELINE] = Timeline(simulation)
        if faults:
            simulation.inflict(faults)
        yield simulation


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Run a test with each of its seeds."""
    marker = item.get_closest_marker("simulation")
    seeds = list(marker.kwargs.get("seeds", ())) if marker else []
    if not seeds:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = _search(item, seeds)
    end = pytest.CallInfo.from_call(lambda: item.session._setupstate.teardown_exact(nextitem), "teardown")
    if end.excinfo is not None:
        reports.append(item.ihook.pytest_runtest_makereport(item=item, call=end))
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _search(item: pytest.Item, seeds: Sequence[int | str]) -> list[pytest.TestReport]:
    """Return the reports of the last seed, or of the first one that fails with the fewest faults."""
    seen: list[Fault] = []
    parents = item.listchain()[:-1]
    sibling: Any = SimpleNamespace(listchain=lambda: parents)  # keeps what the other tests share

    def run(**given: Any) -> list[pytest.TestReport]:
        item.stash[_GIVEN] = given
        reports = runtestprotocol(item, log=False, nextitem=sibling)
        seen[:] = item.stash.get(_SEEN, [])
        return reports

    def fails(reports: Iterable[pytest.TestReport]) -> bool:
        return any(report.when == "call" and report.failed for report in reports)

    for seed in seeds:
        reports = run(seed=seed)
        if not all(report.passed for report in reports):
            break
    if not fails(reports):
        return reports
    faults = list(seen)
    least = minimal(faults, lambda some: fails(run(seed=seed, faults=list(some)))) if faults else faults
    record = _record(item)
    shortest = run(seed=seed, faults=list(least), record=record)
    if fails(shortest):
        reports = shortest
    shown = "".join(f"\n    {fault!r}," for fault in least)
    text = (
        f"Seed {seed!r} fails, number {seeds.index(seed) + 1} of {len(seeds)}."
        f" {len(least)} of its {len(faults)} faults {'is' if len(least) == 1 else 'are'} enough:\n\n"
        f"@pytest.mark.simulation(seed={seed!r}, faults=[{shown}{chr(10) if shown else ''}])"
    )
    text += f"\n\nIts messages: {record}" if record else ""
    for report in reports:
        if report.when == "call":
            report.sections.insert(0, ("Search", text))
    return reports


def _record(item: pytest.Item) -> Path | None:
    """Return where the messages of a failure are recorded; ``None`` without a cache or ros2-python-tools."""
    cache = getattr(item.config, "cache", None)
    if cache is None or find_spec("mcap_files") is None:
        return None
    return Path(cache.mkdir("simulation"), re.sub(r"[^\w.-]", "_", item.name) + ".mcap")


@contextmanager
def recorded(simulation: Simulation, path: Path) -> Iterator[None]:
    """Record all messages until the end of the ``with``, as an MCAP file."""
    from rclpy_simulation.replay.recording import Recording

    recording = Recording(path, None, lambda monotonic: monotonic - BOOT + MIDNIGHT)
    simulation.tap(recording.note)
    try:
        yield
        recording.complete()
    finally:
        recording.discard()


_SEEN = pytest.StashKey[list[Fault]]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Any:
    """Show the output of the simulated processes with a failure."""
    report = yield
    simulation = getattr(item, "funcargs", {}).get("simulation")
    if report.when == "call" and isinstance(simulation, Simulation):
        item.stash[_SEEN] = simulation.faults
        if report.failed:
            if timeline := item.stash.get(_TIMELINE, None):  # a user's own fixture of this name has none
                report.sections.append(("Timeline", timeline.text))
            for end in simulation.ends:
                title = f"Output of {end.name}, pid {end.pid}, exit code {end.exit_code}"
                report.sections.append((title, end.output))
            for process in simulation.processes:
                report.sections.append((f"Output of {process.name}, pid {process.pid}", process.output.text))
    return report
