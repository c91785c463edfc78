"""What every test of this repository relies on: DDS on loopback, and nothing left behind."""

from __future__ import annotations

import importlib.util
import os
import signal
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# tests/conformance tests any rclpy; with ROS 2's own there is no embedded runtime to test.
collect_ignore = (
    [] if importlib.util.find_spec("rosidl_runtime_embedded") else ["deploy/runtime/tests/runtime"]
)

settings.register_profile("reactive-arm", deadline=None)  # a machine that pauses is no defect
settings.load_profile("reactive-arm")

MARK = f"REACTIVE_ARM_TESTS={uuid.uuid4()}"
DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


def pytest_configure() -> None:
    """Mark what the tests start, keep its DDS traffic on loopback, and be signalled like any program."""
    name, _, value = MARK.partition("=")
    os.environ[name] = value
    os.environ[DISCOVERY_RANGE] = "LOCALHOST"
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # also under nohup
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # with clean-up, too
    signal.signal(signal.SIGINT, signal.default_int_handler)  # also in the background of a shell


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where REACTIVE_ARM_SKIPS=fail, a skipped test is a failure, unless the machine cannot help it."""
    if os.environ.get("REACTIVE_ARM_SKIPS") != "fail":
        return
    skipped = session.config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped", [])
    reasons = [str(report.longrepr[2]).removeprefix("Skipped: ") for report in skipped]
    if not all(reason.startswith("platform:") for reason in reasons) and session.exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _left_behind() -> dict[int, str]:
    """The live processes that the tests started, also where their parents are gone."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                if MARK.encode() in (entry / "environ").read_bytes().split(b"\0"):
                    found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except OSError:
                continue
    return found


@pytest.fixture(scope="module", autouse=True)
def _no_process_stays_behind() -> Iterator[None]:
    before = _left_behind()
    yield
    deadline = time.monotonic() + 5.0
    while (left := {pid: command for pid, command in _left_behind().items() if pid not in before}) and (
        time.monotonic() < deadline
    ):
        time.sleep(0.02)
    assert not left, f"processes stay behind: {left}"
