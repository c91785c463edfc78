"""What the monkey does where its victim is not as it expects."""

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

import pytest
import yaml
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64

from deploy.chaos import observer
from deploy.chaos.faults import FAULTS, Undo
from deploy.chaos.history import ALL, NOTHING, Life
from deploy.chaos.marks import BABBLER
from deploy.chaos.observer import Arm, Census
from deploy.supervision import processes
from deploy.supervision.system import System
from interfaces import topics


class Nobody:
    """An arm of which no process lives."""

    namespace = "/arm1"

    def __init__(self, run: Path) -> None:
        self.system = System(run)

    def pid(self, program: str) -> int:
        return 0

    def environment(self) -> dict[str, str]:
        return {**os.environ, processes.MARK: str(self.system.run)}


@pytest.fixture
def nobody(tmp_path: Path) -> Nobody:
    return Nobody(tmp_path)


def test_a_full_disk_without_supervisord_is_nobodys(nobody: Nobody) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    undo = FAULTS["full_disk"].do(nobody, NOTHING)
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == before
    assert undo is not None
    undo()
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == before


def test_a_double_of_what_has_ended_is_none(nobody: Nobody) -> None:
    undo = FAULTS["double"].do(nobody, "sentinel")
    assert undo is not None
    undo()


def test_two_crash_loops_at_a_time_leave_the_good_parameters(nobody: Nobody) -> None:
    good = {"/**": {"ros__parameters": {"scenario": "demo"}}}
    nobody.system.parameters.write_text(yaml.safe_dump(good))
    first = FAULTS["crash_loop"].do(nobody, "config_l1")
    second = FAULTS["crash_loop"].do(nobody, "sentinel")
    during = yaml.safe_load(nobody.system.parameters.read_text())
    assert during.keys() == {"/**", "/arm1/config_l1", "/arm1/sentinel"}
    assert first is not None
    assert second is not None
    first()
    second()
    assert yaml.safe_load(nobody.system.parameters.read_text()) == good


def await_members(system: System, count: int) -> list[processes.Process]:
    """The processes of a system: the kernel shows the environment of a new one a moment later."""
    deadline = time.monotonic() + 10.0
    while len(members := system.members()) < count:
        assert time.monotonic() < deadline
    return members


@pytest.fixture
def babbler(nobody: Nobody, domain_id: int) -> Iterator[int]:
    """The process of a babbler beside the arm."""
    undo: Undo | None = FAULTS["babble"].do(nobody, NOTHING)
    assert undo is not None
    try:
        (member,) = await_members(nobody.system, 1)
        yield member.pid
    finally:
        undo()


@pytest.fixture
def velocity(nobody: Nobody, babbler: int) -> Iterator[subprocess.Popen[bytes]]:
    """A process of the arm, beside the babbler."""
    environment = nobody.environment() | {"SUPERVISOR_PROCESS_NAME": "velocity"}
    with subprocess.Popen(
        [sys.executable, "-c", "import signal; signal.pause()"], env=environment
    ) as process:
        try:
            await_members(nobody.system, 2)
            yield process
        finally:
            process.kill()


def test_a_babbler_is_not_taken_for_supervisord_but_ends_with_its_system(
    nobody: Nobody, babbler: int
) -> None:
    assert nobody.system.members() == [(babbler, BABBLER)]
    assert nobody.system.supervisor() is None
    nobody.system.stop()
    assert nobody.system.members() == []


def test_a_babbler_that_is_ended_in_the_middle_of_a_word_does_not_complain(
    nobody: Nobody,
    capfd: pytest.CaptureFixture[str],  # before the babbler, which says what is captured
    babbler: int,
    make_node: Callable[..., Node],
    executor: SingleThreadedExecutor,
    spin_until: Callable[..., None],
) -> None:
    heard: list[Float64] = []
    node = make_node(namespace=nobody.namespace)
    node.create_subscription(Float64, topics.L1.name, heard.append, topics.L1.qos)
    executor.add_node(node)
    spin_until(lambda: heard)
    assert os.getsid(babbler) == babbler  # no Ctrl-C at the terminal of the monkey reaches it
    nobody.system.stop()
    end = os.waitid(os.P_PID, babbler, os.WEXITED | os.WNOWAIT)
    assert end is not None
    assert end.si_status == signal.SIGTERM
    assert "Traceback" not in capfd.readouterr().err  # our own reader may complain of the babble


FORKING = """
import os, signal, sys  # supervisord, to those who look at the command line
print(flush=True)
sys.stdin.readline()
if os.fork():
    signal.pause()
print(os.getpid(), flush=True)
sys.stdin.readline()
named = {**os.environ, "SUPERVISOR_PROCESS_NAME": "velocity"}
os.execve(sys.executable, [sys.executable, "-c", "print(flush=True); input()"], named)
"""


def test_a_child_of_supervisord_is_named_by_its_program_however_long_that_takes(
    nobody: Nobody, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(observer, "FORK", 0.0)
    monkeypatch.setattr(observer, "UNNAMED", 0.0)
    seen: list[Life] = []
    census = Census(
        [Arm("/", 0, nobody.system.run)], lambda _, life: seen.append(life), lambda begin, end: None
    )
    with subprocess.Popen(
        [sys.executable, "-c", FORKING],
        env=nobody.environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
    ) as supervisord:
        try:
            assert supervisord.stdin is not None
            assert supervisord.stdout is not None
            supervisord.stdout.readline()
            census.look()
            supervisord.stdin.write("fork\n")
            child = int(supervisord.stdout.readline())
            for _ in range(3):
                census.look()
            assert [(life.program, life.pid) for life in seen] == [("", supervisord.pid)]
            supervisord.stdin.write("become velocity\n")
            supervisord.stdout.readline()
            census.look()
            ended = threading.Event()
            ended.set()
            census.run(ended)  # gives back what it holds
        finally:
            supervisord.kill()  # its child reads the end of its input then
    assert [(life.program, life.pid) for life in seen] == [("", supervisord.pid), ("velocity", child)]


def test_a_babbler_is_not_taken_for_a_program(
    nobody: Nobody, babbler: int, velocity: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Life] = []
    census = Census(
        [Arm("/", 0, nobody.system.run)], lambda _, life: seen.append(life), lambda begin, end: None
    )
    census.look()
    ended = threading.Event()
    ended.set()
    census.run(ended)  # gives back what it holds
    assert [(life.program, life.pid) for life in seen] == [("velocity", velocity.pid)]
    killed: list[int] = []
    monkeypatch.setattr(processes, "open_handles", lambda run, pids: killed.extend(pids) or [])
    FAULTS["kill_all"].do(nobody, ALL)
    assert killed == [velocity.pid]
