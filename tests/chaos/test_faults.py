"""Faults whose target does not run, and the processes that the testbed starts in addition to an arm."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64

from deploy.supervision import processes
from deploy.supervision.environment import NAMESPACE
from deploy.supervision.run_directory import ALL as ALL_NODES
from deploy.supervision.run_directory import KEY
from deploy.supervision.system import System
from interfaces import topics
from tests.chaos import process_monitor
from tests.chaos.arm import RealArm
from tests.chaos.faults import FAULT_KINDS, PARAMETERS, Undo
from tests.chaos.process_monitor import STALL, ProcessMonitor, Rounds
from tests.promises.history import ALL, NO_TARGET, Life
from tests.promises.marks import BABBLER


class StoppedArm(RealArm):
    """An arm that does not run."""

    def pid(self, program: str) -> int:
        return 0

    def environment(self) -> dict[str, str]:
        return {**os.environ, processes.MARK: str(self.system.run), NAMESPACE: self.namespace}


@pytest.fixture
def arm(tmp_path: Path) -> RealArm:
    return StoppedArm("/arm1", System(tmp_path))


def injected(kind: str, arm: RealArm, target: str) -> Undo:
    undo = FAULT_KINDS[kind].inject(arm, target)
    assert undo is not None
    return undo


def test_full_disk_without_supervisord_changes_nothing(arm: RealArm) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    undo = injected("full_disk", arm, NO_TARGET)
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == before
    undo()
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == before


def test_duplicate_of_a_stopped_program_starts_nothing(arm: RealArm) -> None:
    injected("double", arm, "sentinel")()


def test_two_crash_loops_restore_the_parameters(arm: RealArm) -> None:
    good = {ALL_NODES: {KEY: {"scenario": "demo"}}}
    arm.system.parameters.write_text(yaml.safe_dump(good))
    first, second = (injected("crash_loop", arm, target) for target in ("config_l1", "sentinel"))
    during = yaml.safe_load(arm.system.parameters.read_text())
    assert during.keys() == {ALL_NODES, "/arm1/config_l1", "/arm1/sentinel"}
    first()
    second()
    assert yaml.safe_load(arm.system.parameters.read_text()) == good


def test_overlapping_crash_loops_of_a_program_last_until_the_last_one_ends(arm: RealArm) -> None:
    good = {ALL_NODES: {KEY: {"scenario": "demo"}}}
    arm.system.parameters.write_text(yaml.safe_dump(good))
    first, second = (injected("crash_loop", arm, "sentinel") for _ in range(2))
    first()
    assert "/arm1/sentinel" in yaml.safe_load(arm.system.parameters.read_text())
    second()
    assert yaml.safe_load(arm.system.parameters.read_text()) == good


def test_supervisord_stays_dead_although_an_overlapping_fault_ends(
    arm: RealArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[System] = []
    monkeypatch.setattr(System, "start_again", lambda system: starts.append(system))
    first, second = (injected("kill_supervisor", arm, ALL) for _ in range(2))
    first()
    assert starts == []
    second()
    assert starts == [arm.system]


def is_stopped(pid: int) -> bool:
    return processes.stat_of(pid)[0] == "T"


def is_full(pid: int) -> bool:
    return resource.prlimit(pid, resource.RLIMIT_FSIZE)[0] == 1


@pytest.mark.parametrize(("kind", "is_wrong"), [("stop", is_stopped), ("full_disk", is_full)])
def test_a_fault_lasts_although_an_overlapping_one_ends(
    kind: str, is_wrong: Callable[[int], bool], arm: RealArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    def await_wrong(pid: int, wrong: bool) -> None:
        """Wait for the kernel: it stops a process a moment after the signal."""
        deadline = time.monotonic() + 10.0
        while is_wrong(pid) != wrong:
            assert time.monotonic() < deadline

    with subprocess.Popen(["sleep", "60"], env=arm.environment()) as process:
        try:
            await_members(arm.system, 1)
            monkeypatch.setattr(arm, "pid", lambda program: process.pid)
            monkeypatch.setattr(System, "supervisor", lambda system: process.pid)
            first, second = (injected(kind, arm, "velocity") for _ in range(2))
            await_wrong(process.pid, True)
            first()
            assert is_wrong(process.pid)
            second()
            await_wrong(process.pid, False)
        finally:
            process.kill()


def test_crash_loops_break_a_number_of_a_program() -> None:
    assert PARAMETERS["config_l1"] == "value"
    assert PARAMETERS["dead_mans_switch"] == "rate"
    assert "kinematics" not in PARAMETERS


def await_members(system: System, count: int) -> list[processes.Process]:
    """Wait for the processes of a system: the kernel shows the environment of a new one a moment later."""
    deadline = time.monotonic() + 10.0
    while len(members := system.members()) < count:
        assert time.monotonic() < deadline
    return members


@pytest.fixture
def babbler(arm: RealArm, domain_id: int) -> Iterator[int]:
    undo = injected("babble", arm, NO_TARGET)
    try:
        (member,) = await_members(arm.system, 1)
        yield member.pid
    finally:
        undo()


@pytest.fixture
def velocity(arm: RealArm, babbler: int) -> Iterator[subprocess.Popen[bytes]]:
    environment = arm.environment() | {"SUPERVISOR_PROCESS_NAME": "velocity"}
    with subprocess.Popen(
        [sys.executable, "-c", "import signal; signal.pause()"], env=environment
    ) as process:
        try:
            await_members(arm.system, 2)
            yield process
        finally:
            process.kill()


def test_babbler_is_not_supervisord_but_ends_with_its_system(arm: RealArm, babbler: int) -> None:
    assert arm.system.members() == [(babbler, BABBLER)]
    assert arm.system.supervisor() is None
    arm.system.stop()
    assert arm.system.members() == []


def test_babbler_ends_without_a_traceback(
    arm: RealArm,
    capfd: pytest.CaptureFixture[str],  # first, to capture the babbler's output
    babbler: int,
    make_node: Callable[..., Node],
    executor: SingleThreadedExecutor,
    spin_until: Callable[..., None],
) -> None:
    heard: list[Float64] = []
    node = make_node(namespace=arm.namespace)
    node.create_subscription(Float64, topics.L1.name, heard.append, topics.L1.qos)
    executor.add_node(node)
    spin_until(lambda: heard)
    assert os.getsid(babbler) == babbler  # Ctrl-C at the terminal does not reach it
    arm.system.stop()
    end = os.waitid(os.P_PID, babbler, os.WEXITED | os.WNOWAIT)
    assert end is not None
    assert end.si_status == signal.SIGTERM
    assert "Traceback" not in capfd.readouterr().err  # the reader of this test may report the babble


def run_until_end(
    arm: RealArm, program: subprocess.Popen[bytes], report: Callable[[Life], None]
) -> list[float]:
    """Monitor a process until its end; return how long each overload lasted."""
    overloads: list[float] = []
    ended = threading.Event()

    def note(_: str, life: Life) -> None:
        if life.ended is None:
            program.kill()
        else:
            report(life)
            ended.set()

    monitor = ProcessMonitor({arm.system.run: "/"}, note, lambda begin, end: overloads.append(end - begin))
    monitor.run(ended)
    return overloads


def test_a_stall_while_an_end_is_reported_is_an_overload(
    arm: RealArm, velocity: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    ahead = 0.0

    def stall(life: Life) -> None:
        nonlocal ahead
        ahead += 60.0

    monotonic = time.monotonic
    monkeypatch.setattr(process_monitor, "time", SimpleNamespace(**vars(time)))
    monkeypatch.setattr(process_monitor.time, "monotonic", lambda: monotonic() + ahead)
    assert max(run_until_end(arm, velocity, stall), default=0.0) >= 60.0


def test_a_late_round_is_an_overload() -> None:
    late: list[tuple[float, float]] = []
    rounds = Rounds(lambda begin, end: late.append((begin, end)))
    for now in (1.0, 1.09, 1.2, 1.25, 4.0):
        rounds.note(now)
    assert late == [(1.09, 1.2), (1.25, 4.0)]


ON_ONE_PROCESSOR = """
import os, time
os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
"""
PATIENT = f"""{ON_ONE_PROCESSOR}
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
print(flush=True)
while True:
    pass
"""
BUSY = f"""{ON_ONE_PROCESSOR}
while time.process_time() < 1.0:
    pass
"""


def test_a_process_that_waits_long_for_a_processor_shows_an_overload(arm: RealArm) -> None:
    waits: list[float] = []
    monitor = ProcessMonitor(
        {arm.system.run: "/"}, lambda *_: None, lambda begin, end: waits.append(end - begin)
    )
    environment = arm.environment() | {"SUPERVISOR_PROCESS_NAME": "velocity"}
    with (
        subprocess.Popen([sys.executable, "-c", PATIENT], env=environment, stdout=subprocess.PIPE) as patient,
        subprocess.Popen([sys.executable, "-c", BUSY]) as busy,
    ):
        try:
            assert patient.stdout is not None
            patient.stdout.readline()
            deadline = time.monotonic() + 60.0
            while not waits and time.monotonic() < deadline:
                monitor.scan()
            close(monitor)
        finally:
            busy.kill()
            patient.kill()
    assert max(waits, default=0.0) > STALL


def test_a_process_that_is_reaped_while_it_is_found_leaves_no_handle(
    arm: RealArm, velocity: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    def handles() -> int:
        return len(os.listdir("/proc/self/fd"))

    def open_late(pid: int) -> int:
        handle = pidfd_open(pid)
        velocity.kill()
        velocity.wait()
        return handle

    pidfd_open, before = os.pidfd_open, handles()
    monkeypatch.setattr(os, "pidfd_open", open_late)
    monitor = monitor_of(arm, [])
    monitor.scan()
    assert velocity.returncode is not None
    close(monitor)
    assert handles() == before


def monitor_of(arm: RealArm, seen: list[Life]) -> ProcessMonitor:
    return ProcessMonitor({arm.system.run: "/"}, lambda _, life: seen.append(life), lambda *_: None)


def close(monitor: ProcessMonitor) -> None:
    ended = threading.Event()
    ended.set()
    monitor.run(ended)


FORKING = """
import os, signal, sys  # the command line contains the word supervisord
print(flush=True)
sys.stdin.readline()
if os.fork():
    signal.pause()
print(os.getpid(), flush=True)
sys.stdin.readline()
named = {**os.environ, "SUPERVISOR_PROCESS_NAME": "velocity"}
os.execve(sys.executable, [sys.executable, "-c", "print(flush=True); input()"], named)
"""


def test_slow_child_of_supervisord_is_identified_by_its_program(
    arm: RealArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process_monitor, "FORK_TIME", 0.0)
    monkeypatch.setattr(process_monitor, "NAMING_TIMEOUT", 0.0)
    seen: list[Life] = []
    monitor = monitor_of(arm, seen)
    with subprocess.Popen(
        [sys.executable, "-c", FORKING],
        env=arm.environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
    ) as supervisord:
        try:
            assert supervisord.stdin is not None
            assert supervisord.stdout is not None
            supervisord.stdout.readline()
            monitor.scan()
            supervisord.stdin.write("fork\n")
            child = int(supervisord.stdout.readline())
            for _ in range(3):
                monitor.scan()
            assert [(life.program, life.pid) for life in seen] == [("", supervisord.pid)]
            supervisord.stdin.write("become velocity\n")
            supervisord.stdout.readline()
            monitor.scan()
            close(monitor)
        finally:
            supervisord.kill()  # its child then reads the end of its input
    assert [(life.program, life.pid) for life in seen] == [("", supervisord.pid), ("velocity", child)]


def test_babbler_is_not_a_program_of_the_arm(
    arm: RealArm, babbler: int, velocity: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Life] = []
    monitor = monitor_of(arm, seen)
    monitor.scan()
    close(monitor)
    assert [(life.program, life.pid) for life in seen] == [("velocity", velocity.pid)]
    killed: list[int] = []
    monkeypatch.setattr(processes, "open_handles", lambda run, pids: killed.extend(pids) or [])
    FAULT_KINDS["kill_all"].inject(arm, ALL)
    assert killed == [velocity.pid]
