"""What the set-up makes of a .venv, and says, where it cannot make one; in a checkout of the test's own."""

from __future__ import annotations

import os
import select
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from deploy.commands import setup

ROOT = Path(__file__).parents[2]
STAMP = ".venv/made-from"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """What of a checkout the set-up consists of."""
    checkout = tmp_path / "checkout"
    (checkout / "deploy" / "supervision").mkdir(parents=True)
    (checkout / "deploy" / "commands").mkdir()
    shutil.copytree(ROOT / "deploy" / "requirements", checkout / "deploy" / "requirements")
    for name in (
        "Makefile",
        "deploy/__init__.py",
        "deploy/supervision/__init__.py",
        "deploy/supervision/processes.py",
        "deploy/commands/__init__.py",
        "deploy/commands/setup.py",
        "deploy/commands/setup.sh",
    ):
        shutil.copyfile(ROOT / name, checkout / name)
    return checkout


def set_up(checkout: Path, **environment: str) -> tuple[int, str]:
    """Set it up: the exit code, and what was said of errors."""
    done = subprocess.run(
        [sys._base_executable, "-m", "deploy.commands.setup"],
        cwd=checkout,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=30,
    )
    return done.returncode, done.stderr


def make(checkout: Path, command: str) -> str:
    """What a command of make says, which ends well."""
    return subprocess.run(
        ["make", command], cwd=checkout, check=True, stdout=subprocess.PIPE, text=True
    ).stdout.strip()


def test_what_tools_leave_behind_is_no_part_of_the_runtime(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(setup, "ROOT", tmp_path)
    source = tmp_path / "src" / "rclpy" / "node.py"
    source.parent.mkdir(parents=True)
    source.touch()
    (tmp_path / "pyproject.toml").touch()
    before = setup.fingerprint_of(tmp_path)
    for name in (".ruff_cache/x", "build/x", "src/rclpy.egg-info/x", "src/rclpy/__pycache__/x"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).touch()
    assert setup.fingerprint_of(tmp_path) == before
    source.write_text("changed")
    assert setup.fingerprint_of(tmp_path) != before


def test_a_set_up_that_is_refused_leaves_what_there_is(checkout: Path, tmp_path: Path) -> None:
    stamp = checkout / STAMP
    stamp.parent.mkdir()
    stamp.write_text("another shell's environment")
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text("raise ImportError('made for another Python')")
    code, said = set_up(checkout, PYTHONPATH=str(tmp_path))
    assert code == 1
    assert "made for another Python" in said
    assert stamp.read_text() == "another shell's environment"


def test_an_error_of_the_file_system_is_told_in_a_line(checkout: Path) -> None:
    (checkout / ".venv").touch()
    code, said = set_up(checkout)
    assert code == 1
    assert said == f"Set-up failed: [Errno 20] Not a directory: '{checkout / STAMP}'\n"


@pytest.mark.parametrize("command", ["console", "status", "logs", "stop"])
def test_half_a_set_up_runs_nothing(checkout: Path, command: str) -> None:
    python = checkout / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\necho runs $*\n")
    python.chmod(0o755)
    assert make(checkout, command) == "Nothing runs: .venv is not set up (make setup)."
    (checkout / STAMP).touch()
    assert make(checkout, command) == f"runs -m deploy.commands.launcher {command}"


def test_an_interrupted_step_ends_with_all_its_children(tmp_path: Path) -> None:
    begun = tmp_path / "pid"

    def interrupt() -> None:
        while not begun.exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    interrupter = threading.Thread(target=interrupt)
    interrupter.start()
    with pytest.raises(KeyboardInterrupt):
        setup._step(
            "a long sleep",
            ["sh", "-c", f"sleep 60 & echo $! > {begun}.new; mv {begun}.new {begun}; wait"],
            log=None,
        )
    interrupter.join()
    with suppress(ProcessLookupError):  # whoever has adopted it has seen its end already
        child = os.pidfd_open(int(begun.read_text()))
        try:
            assert select.select([child], [], [], 10)[0]
        finally:
            os.close(child)
