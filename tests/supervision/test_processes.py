"""Whom the end of a system reaches, and whom not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from deploy.supervision import processes

Spawn = Callable[..., "subprocess.Popen[bytes]"]
READY = "print(flush=True); "


@pytest.fixture
def spawn() -> Iterator[Spawn]:
    """Starts Python code in a process with more in its environment; returns when the code runs."""
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


def test_members_are_found_by_their_mark_and_know_their_program(spawn: Spawn, tmp_path: Path) -> None:
    marked = {processes.MARK: str(tmp_path)}
    supervisor = spawn(**marked)
    service = spawn(**marked, SUPERVISOR_PROCESS_NAME="velocity")
    spawn(**{processes.MARK: str(tmp_path / "other")}, SUPERVISOR_PROCESS_NAME="velocity")
    spawn(SUPERVISOR_PROCESS_NAME="velocity")
    assert processes.of_system(tmp_path) == [(supervisor.pid, ""), (service.pid, "velocity")]


def test_who_uses_a_directory_of_programs_is_found_wherever_it_runs(spawn: Spawn, tmp_path: Path) -> None:
    programs, elsewhere = tmp_path / "bin", os.environ["PATH"]
    marked = {processes.MARK: str(tmp_path / "run")}
    spawn(**marked, PATH=f"{programs}:{elsewhere}")
    spawn(**marked, SUPERVISOR_PROCESS_NAME="velocity", PATH=f"{programs}:{elsewhere}")
    spawn(**{processes.MARK: str(tmp_path / "other")}, PATH=f"{elsewhere}:{programs}")
    spawn(PATH=f"{programs}:{elsewhere}")
    assert processes.using(programs) == [tmp_path / "run"]


def test_a_member_that_heeds_sigterm_ends_by_it(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(**{processes.MARK: str(tmp_path)})
    processes.end(tmp_path, [process.pid], grace=10.0)
    assert process.wait() == -signal.SIGTERM


def test_a_member_that_does_not_is_killed_after_its_grace(spawn: Spawn, tmp_path: Path) -> None:
    deaf = "signal.signal(signal.SIGTERM, signal.SIG_IGN); " + READY + "\nwhile True: signal.pause()"
    process = spawn(deaf, **{processes.MARK: str(tmp_path)})
    processes.end(tmp_path, [process.pid], grace=0.1)
    assert process.wait() == -signal.SIGKILL


def test_a_stopped_member_ends_as_well(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(**{processes.MARK: str(tmp_path)})
    process.send_signal(signal.SIGSTOP)
    processes.end(tmp_path, [process.pid], grace=0.1)
    assert process.wait() in (-signal.SIGTERM, -signal.SIGKILL)


def test_a_process_without_the_mark_is_spared_although_its_pid_is_given(spawn: Spawn, tmp_path: Path) -> None:
    stranger = spawn()
    processes.end(tmp_path, [stranger.pid], grace=0.1)
    assert stranger.poll() is None


def test_a_pid_that_nobody_has_any_more_is_no_mistake(spawn: Spawn, tmp_path: Path) -> None:
    process = spawn(READY)
    process.wait()
    processes.end(tmp_path, [process.pid], grace=0.1)
