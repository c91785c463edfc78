from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from deploy.supervision import processes

Spawn = Callable[..., "subprocess.Popen[bytes]"]
READY = "print(flush=True); "


@pytest.fixture
def spawn() -> Iterator[Spawn]:
    """A function that starts Python code in a process with more variables, and returns when it runs."""
    with ExitStack() as stack:

        def spawn(code: str = READY + "signal.pause()", **environment: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(
                [sys.executable, "-c", "import signal; " + code],
                env=os.environ | environment,
                stdout=subprocess.PIPE,
            )
            stack.enter_context(process)
            stack.callback(process.kill)
            assert process.stdout is not None
            process.stdout.readline()
            return process

        yield spawn


def test_members_are_found_by_their_mark(spawn: Spawn, tmp_path: Path) -> None:
    marked = {processes.MARK: str(tmp_path)}
    supervisor = spawn(**marked)
    service = spawn(**marked, SUPERVISOR_PROCESS_NAME="velocity")
    spawn(**{processes.MARK: str(tmp_path / "other")}, SUPERVISOR_PROCESS_NAME="velocity")
    spawn(SUPERVISOR_PROCESS_NAME="velocity")
    assert processes.of_system(tmp_path) == [(supervisor.pid, ""), (service.pid, "velocity")]


def test_systems_that_use_a_directory_of_programs_are_found(spawn: Spawn, tmp_path: Path) -> None:
    programs, elsewhere = tmp_path / "bin", os.environ["PATH"]
    marked = {processes.MARK: str(tmp_path / "run")}
    spawn(**marked, PATH=f"{programs}:{elsewhere}")
    spawn(**marked, SUPERVISOR_PROCESS_NAME="velocity", PATH=f"{programs}:{elsewhere}")
    spawn(**{processes.MARK: str(tmp_path / "other")}, PATH=f"{elsewhere}:{programs}")
    spawn(PATH=f"{programs}:{elsewhere}")
    spawn(**marked, SUPERVISOR_PROCESS_NAME="sentinel", PATH=f"/shims:{programs}:{elsewhere}")  # of pyenv
    assert processes.using(programs) == [tmp_path / "run"]


def test_a_member_ends_by_sigterm(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(**{processes.MARK: str(tmp_path)})
    processes.end(tmp_path, [process.pid], grace=10.0)
    assert process.wait() == -signal.SIGTERM


def test_a_member_that_ignores_sigterm_is_killed(spawn: Spawn, tmp_path: Path) -> None:
    deaf = "signal.signal(signal.SIGTERM, signal.SIG_IGN); " + READY + "\nwhile True: signal.pause()"
    process = spawn(deaf, **{processes.MARK: str(tmp_path)})
    processes.end(tmp_path, [process.pid], grace=0.1)
    assert process.wait() == -signal.SIGKILL


def test_a_stopped_member_ends_as_well(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(**{processes.MARK: str(tmp_path)})
    process.send_signal(signal.SIGSTOP)
    processes.end(tmp_path, [process.pid], grace=0.1)
    assert process.wait() in (-signal.SIGTERM, -signal.SIGKILL)


def test_a_process_without_the_mark_is_spared(spawn: Spawn, tmp_path: Path) -> None:
    stranger = spawn()
    processes.end(tmp_path, [stranger.pid], grace=0.1)
    assert stranger.poll() is None


def test_a_pid_of_no_process_is_ignored(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(READY)
    process.wait()
    processes.end(tmp_path, [process.pid], grace=0.1)


def test_signal_reaches_the_process_of_a_program(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(**{processes.MARK: str(tmp_path)}, SUPERVISOR_PROCESS_NAME="velocity")

    assert processes.send_signal(tmp_path, "velocity", process.pid, signal.SIGKILL)

    assert process.wait() == -signal.SIGKILL


def test_signal_reaches_no_other_process(spawn: Spawn, tmp_path: Path) -> None:
    other_program = spawn(**{processes.MARK: str(tmp_path)}, SUPERVISOR_PROCESS_NAME="kinematics")
    other_system = spawn(**{processes.MARK: str(tmp_path / "other")}, SUPERVISOR_PROCESS_NAME="velocity")
    stranger = spawn(SUPERVISOR_PROCESS_NAME="velocity")
    ended = spawn(READY, **{processes.MARK: str(tmp_path)}, SUPERVISOR_PROCESS_NAME="velocity")
    ended.wait()

    for pid in (other_program.pid, other_system.pid, stranger.pid, ended.pid, 0, -1, 1):
        assert not processes.send_signal(tmp_path, "velocity", pid, signal.SIGKILL)

    assert [each.poll() for each in (other_program, other_system, stranger)] == [None, None, None]


def _effort(pid: int) -> processes.Effort:
    found = processes.effort_of(pid, processes.stat_of(pid))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("code", "busy"),
    [
        ("loop()", "loop"),
        ("import threading; threading.Thread(target=loop, daemon=True).start(); signal.pause()", "others"),
    ],
)
def test_effort_of_the_loop_and_of_other_threads_is_distinguished(spawn: Spawn, code: str, busy: str) -> None:
    loop = "loop = lambda: [None for _ in iter(int, 1)]; "
    pid = spawn(f"{loop}{READY}{code}").pid
    deadline = time.monotonic() + 20.0
    before = _effort(pid)
    while getattr(_effort(pid), busy) - getattr(before, busy) < 0.5:
        assert time.monotonic() < deadline, _effort(pid)
        time.sleep(0.05)
    after = _effort(pid)
    other = "others" if busy == "loop" else "loop"
    assert getattr(after, other) - getattr(before, other) < 0.25


def test_a_process_that_is_not_there_makes_no_effort() -> None:
    assert processes.effort_of(0, []) is None
    assert processes.effort_of(0, processes.stat_of(os.getpid())) is None
