"""Rules for all tests of this repository: DDS stays on loopback, and processes end with the test module."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import time
import uuid
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import Phase, settings

from tests import order, tiers
from tests.runtimes import left_out_here, needs_virtual_time

collect_ignore: list[str] = []

settings.register_profile("reactive-arm", deadline=None)  # a busy machine is no defect
# For `make mutants`: whether a test fails, not the smallest example; the same examples each time.
settings.register_profile("mutants", deadline=None, derandomize=True, phases=[Phase.explicit, Phase.generate])
# For `.ci/run`: once more on another Python or middleware. The main run has tried more examples.
settings.register_profile("again", deadline=None, max_examples=10)
settings.load_profile("reactive-arm")

MARK = "REACTIVE_ARM_TESTS"
"""An environment variable that all processes of a test session inherit."""
RESOURCE_TRACKER = "multiprocessing.resource_tracker"
"""A process of this name ends with the one that has started it, perhaps this one."""


def pytest_configure(config: pytest.Config) -> None:
    """Choose the ground of rclpy, which this process keeps; set the mark, the middleware and the signals."""
    simulated = needs_virtual_time(config.args)
    if simulated:
        register(config, "rclpy_simulation.testing")  # before rclpy
    register(config, "reactive_node.testing")
    collect_ignore[:] = left_out_here(simulated=simulated)
    os.environ[MARK] = str(uuid.uuid4())
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    if "FASTDDS_DEFAULT_PROFILES_FILE" not in os.environ:  # ROS 2 Kilted warns of the older name
        os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(Path(__file__).with_name("deploy") / "fastdds.xml")
    os.environ |= without_shared_memory()
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # fixtures clean up


def register(config: pytest.Config, name: str) -> None:
    """Register a plugin that a conftest.py may have imported already."""
    config.pluginmanager.register(importlib.import_module(name), name)


def without_shared_memory() -> dict[str, str]:
    """Return what keeps nodes of the tests from shared memory, which a killed process leaves behind."""
    if "FASTDDS_DEFAULT_PROFILES_FILE" in os.environ:  # ROS 2 Kilted, which has not all messages of the arm
        return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}  # .ci/run: the range is in the profile
    from interfaces.service import middleware

    return middleware.settings()


@pytest.fixture
def domain_id(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> int:
    """A free ROS domain; the environment selects it and keeps its traffic on this machine."""
    for name, value in without_shared_memory().items():
        monkeypatch.setenv(name, value)
    return domain_id


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect the tests without garbage collection: it would take a third of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)  # before `-m` selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        item.add_marker(tiers.tier(item.path, getattr(item, "fixturenames", ())))
    items.sort(key=lambda item: order.place(item.nodeid))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """With REACTIVE_ARM_SKIPS=fail, fail if a test was skipped for a reason other than "platform: …"."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")  # none in a worker of pytest-xdist
    if os.environ.get("REACTIVE_ARM_SKIPS") != "fail" or not reporter:
        return
    skipped = reporter.stats.get("skipped", [])
    reasons = [str(report.longrepr[2]).removeprefix("Skipped: ") for report in skipped]
    if not all(reason.startswith("platform:") for reason in reasons) and session.exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _started_processes() -> dict[int, str]:
    """Return the live processes of this session, orphans included, with their commands."""
    mark = f"{MARK}={os.environ[MARK]}".encode()
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                is_ours = mark in (entry / "environ").read_bytes().split(b"\0")
                if is_ours and RESOURCE_TRACKER not in command:
                    found[int(entry.name)] = command
            except OSError:
                continue
    return found


@pytest.fixture(scope="module", autouse=True)
def _processes_end_with_module() -> Iterator[None]:
    before = _started_processes().keys()
    yield
    deadline = time.monotonic() + 5.0
    while left := {pid: command for pid, command in _started_processes().items() if pid not in before}:
        assert time.monotonic() < deadline, f"processes outlive their test module: {left}"
        time.sleep(0.02)
