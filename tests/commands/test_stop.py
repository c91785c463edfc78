"""The end of a system whose processes do not obey: `make stop` has little patience with them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from deploy.supervision import processes, rpc
from deploy.supervision.system import System

HANGS = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True); signal.pause()"
NEVER_ANSWERS = (
    "import signal, socket; door = socket.socket(socket.AF_UNIX); door.bind('supervisor.sock');"
    "door.listen(); print(flush=True); signal.pause()"
)


@pytest.fixture
def system(tmp_path: Path) -> Iterator[Any]:
    """A function that starts members of a system, each with its code, and returns the system."""
    with ExitStack() as stack:

        def start(**members: str) -> System:
            for program, code in members.items():
                name = "" if program == "supervisord" else program
                process = subprocess.Popen(
                    [sys.executable, "-c", code],
                    cwd=tmp_path,
                    env=os.environ | {processes.MARK: str(tmp_path), "SUPERVISOR_PROCESS_NAME": name},
                    stdout=subprocess.PIPE,
                )
                stack.enter_context(process)
                stack.callback(process.kill)
                assert process.stdout is not None
                process.stdout.readline()
            return System(tmp_path)

        yield start


def test_hung_service_is_killed_after_a_second(system: Any) -> None:
    hung = system(velocity=HANGS)
    began = time.monotonic()

    assert hung.stop() == 1

    assert 1.0 <= time.monotonic() - began < 3.0
    assert hung.members() == []


def test_supervisord_that_obeys_too_slowly_is_killed(system: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    hung = system(supervisord=HANGS)
    calls: list[Any] = []
    monkeypatch.setattr(rpc, "call", lambda pid, method, timeout: calls.append((pid, method)))
    supervisor = hung.supervisor()
    began = time.monotonic()

    assert hung.stop() == 1

    assert calls == [(supervisor, "supervisor.shutdown")]
    assert 1.4 <= time.monotonic() - began < 3.0
    assert hung.members() == []


def test_supervisord_that_does_not_answer_is_killed_at_once(system: Any) -> None:
    hung = system(supervisord=NEVER_ANSWERS)
    began = time.monotonic()

    assert hung.stop() == 1

    assert time.monotonic() - began < 2.0
    assert hung.members() == []
