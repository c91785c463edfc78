"""What every test may rely on: a DDS domain of its own on loopback, nodes in it, and nothing left behind."""

from __future__ import annotations

import importlib.util
import os
import signal
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import rclpy
from hypothesis import settings
from rclpy.clock import ROSClock
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time
from rclpy.time_source import TimeSource

from deploy.chaos.domain import reserved_domain

# What any rclpy does is in tests/conformance; on that of ROS 2 there is no embedded runtime to test besides.
collect_ignore = [] if importlib.util.find_spec("rosidl_runtime_embedded") else ["runtime"]

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


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A free ROS_DOMAIN_ID, in the environment too."""
    with reserved_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        yield domain


@pytest.fixture(scope="module")
def module_domain_id() -> Iterator[int]:
    """A free ROS_DOMAIN_ID for what the tests of a module share; the environment stays as it is."""
    with reserved_domain() as domain:
        yield domain


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:
    """An initialized context that handles no signals, in a domain of its own."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()


@pytest.fixture
def make_node(context: Context) -> Iterator[Callable[..., Node]]:
    """Makes nodes of the test's context and ends them with the test."""
    with ExitStack() as stack:

        def make(name: str = "node", **options: Any) -> Node:
            node = Node(name, **{"context": context, **options})
            stack.callback(node.destroy_node)
            return node

        yield make


@pytest.fixture
def executor(context: Context) -> Iterator[SingleThreadedExecutor]:
    """A single-threaded executor of the test's context."""
    with SingleThreadedExecutor(context=context) as executor:
        yield executor


@pytest.fixture
def node(make_node: Callable[..., Node], executor: SingleThreadedExecutor) -> Node:
    """A node that the test's executor spins."""
    node = make_node()
    executor.add_node(node)
    return node


@pytest.fixture
def spin_until(executor: SingleThreadedExecutor) -> Callable[..., None]:
    """Spins the test's executor until a condition is true; fails when that takes too long."""

    def spin(condition: Callable[[], object], seconds: float = 10.0) -> None:
        clock = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)
        deadline = clock.now().nanoseconds + int(seconds * 1e9)
        while not condition():
            assert clock.now().nanoseconds < deadline, f"not within {seconds} s"
            executor.spin_once(timeout_sec=0.1)

    return spin


@pytest.fixture
def clock() -> ROSClock:
    """ROS time that stands still, 1 µs after its epoch, unless the test moves it."""
    clock, simulator = ROSClock(), TimeSource()
    simulator.ros_time_is_active = True
    simulator.attach_clock(clock)
    clock.set_ros_time_override(Time(nanoseconds=1000, clock_type=clock.clock_type))
    return clock


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
