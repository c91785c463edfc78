"""The set-up of .venv where it fails, in a checkout of its own."""

from __future__ import annotations

import fcntl
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from deploy.commands import setup

ROOT = Path(__file__).parents[2]
STAMP = ".venv/made-from"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with the files of the set-up and of `make stop`."""
    checkout = tmp_path / "checkout"
    for name in ("requirements", "supervision", "commands", "operator"):
        ignored = shutil.ignore_patterns("__pycache__")  # other workers write there
        shutil.copytree(ROOT / "deploy" / name, checkout / "deploy" / name, ignore=ignored)
    for name in ("Makefile", "deploy/__init__.py", "deploy/supervisord.conf"):
        shutil.copyfile(ROOT / name, checkout / name)
    return checkout


def set_up(checkout: Path, **environment: str) -> tuple[int, str]:
    """Set a checkout up: the exit code and the errors."""
    done = subprocess.run(
        [sys._base_executable, "-m", "deploy.commands.setup"],
        cwd=checkout,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=30,
    )
    return done.returncode, done.stderr


def make(checkout: Path, command: str) -> tuple[int, str]:
    """Do a command of make: the exit code and the first line of its output."""
    done = subprocess.run(
        ["make", command], cwd=checkout, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    return done.returncode, done.stdout.splitlines()[0]


def test_a_refused_set_up_leaves_the_old_one(checkout: Path, tmp_path: Path) -> None:
    stamp = checkout / STAMP
    stamp.parent.mkdir()
    stamp.write_text("another shell's environment")
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text("raise ImportError('made for another Python')")
    code, errors = set_up(checkout, PYTHONPATH=str(tmp_path), RUNTIME="")
    assert code == 1
    assert "made for another Python" in errors
    assert stamp.read_text() == "another shell's environment"


def test_the_interpreter_is_none_of_an_interrupted_set_up(checkout: Path) -> None:
    python = checkout / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.symlink_to(os.path.realpath(sys._base_executable))  # there is no pyvenv.cfg
    (checkout / "show.py").write_text("import sys; print(sys.executable)")
    shown = subprocess.run(
        ["deploy/commands/python.sh", "show"], cwd=checkout, capture_output=True, text=True
    )
    assert shown.stdout == f"{python.readlink()}\n"


def test_an_error_of_the_file_system_is_one_line(checkout: Path) -> None:
    (checkout / ".venv").touch()
    code, errors = set_up(checkout)
    assert code == 1
    assert errors == f"Set-up failed: [Errno 20] Not a directory: '{checkout / STAMP}'\n"


@pytest.mark.parametrize("command", ["terminal", "status", "logs"])
def test_half_a_set_up_runs_no_command(checkout: Path, command: str) -> None:
    python = checkout / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\necho runs $*\n")
    python.chmod(0o755)
    code, printed = make(checkout, command)
    assert code != 0
    assert printed == ".venv is not set up: make setup (make stop works without it)"
    (checkout / STAMP).touch()
    assert make(checkout, command) == (0, f"runs -m deploy.commands.launcher {command}")


def test_make_stop_works_without_a_set_up_and_leaves_no_files(checkout: Path) -> None:
    assert make(checkout, "stop") == (0, "Nothing runs.")
    assert not (checkout / ".run").exists()


def test_make_stop_works_in_a_read_only_checkout(checkout: Path) -> None:
    (checkout / ".run").mkdir()
    (checkout / ".run" / "parameters.yaml").touch()
    read_only = ["unshare", "--mount", "--map-root-user", "sh", "-c"]
    script = (
        'mount --bind "$PWD" "$PWD" && mount -o remount,bind,ro "$PWD" && cd "$PWD" && ! touch x && make stop'
    )
    done = subprocess.run([*read_only, script], cwd=checkout, capture_output=True, text=True)
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip(f"platform: {done.stderr}")
    assert (done.returncode, done.stdout) == (0, "Nothing runs.\n")


def test_a_quote_in_a_variable_of_make_is_no_shell_syntax(checkout: Path) -> None:
    done = subprocess.run(["make", "stop", "PYTHON=it's"], cwd=checkout, capture_output=True, text=True)
    assert done.stderr.splitlines()[:-1] == ["PYTHON=it's is not a Python 3.11, 3.12 or 3.13"]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (
            "run SCENRIO=demo",
            "run has no variable SCENRIO; it has PYTHON RUNTIME SCENARIO PARAMETERS MANIFEST WEB HOST SECURE",
        ),
        ("SCENARIO=demo", "help has no variable SCENARIO; it has PYTHON RUNTIME"),
        (
            "chaos MINUTES=1 HOURS=1",
            "chaos has no variable HOURS; it has PYTHON RUNTIME MINUTES SEED CHAOS SECURE",
        ),
        ("help PYTHON=python3 ROS_DOMAIN_ID=1", ""),
        ("stop SCENRIO=demo", ""),
    ],
)
def test_a_variable_that_make_would_ignore_is_refused(checkout: Path, words: str, problem: str) -> None:
    outside = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(["make", *words.split()], cwd=checkout, env=outside, capture_output=True, text=True)
    if problem:
        assert (done.returncode, done.stdout) == (2, "")
        assert re.fullmatch(rf"Makefile:\d+: \*\*\* make {problem}\.  Stop\.\n", done.stderr)
    else:
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("free", "words"), [(2e9, ""), (3e6, f"3 MB are free on the disk of {ROOT}")])
def test_a_step_that_fails_on_a_full_disk_tells_the_free_space(
    monkeypatch: pytest.MonkeyPatch, free: float, words: str
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: mock.Mock(free=free))
    with pytest.raises(setup.SetupError) as raised:
        setup.step("a step", ["sh", "-c", "echo no reason; exit 1"], log=None)
    assert str(raised.value) == f"Set-up failed at a step:\nno reason\n{words}".rstrip()


def test_an_interrupt_waits_until_the_step_can_be_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[subprocess.Popen[str]] = []

    class Interrupted(subprocess.Popen[str]):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            begun.append(self)
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)

    monkeypatch.setattr(subprocess, "Popen", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        setup.step("a long sleep", ["sleep", "60"], log=None)
    assert begun[0].returncode == -signal.SIGTERM


def test_an_interrupted_step_ends_with_all_its_children(tmp_path: Path) -> None:
    begun = tmp_path / "pid"
    main_thread = threading.get_ident()

    def interrupt() -> None:
        while not begun.exists():
            time.sleep(0.01)
        signal.pthread_kill(main_thread, signal.SIGINT)

    interrupter = threading.Thread(target=interrupt)
    interrupter.start()
    with pytest.raises(KeyboardInterrupt):
        setup.step(
            "a long sleep",
            ["sh", "-c", f"sleep 60 & echo $! > {begun}.new; mv {begun}.new {begun}; wait"],
            log=None,
        )
    interrupter.join()
    with suppress(ProcessLookupError):  # its new parent has seen its end already
        child = os.pidfd_open(int(begun.read_text()))
        try:
            assert select.select([child], [], [], 10)[0]
        finally:
            os.close(child)


def test_a_step_that_outlives_a_killed_set_up_keeps_the_lock(checkout: Path) -> None:
    begun, end = checkout / "begun", checkout / "end"
    os.mkfifo(begun)
    os.mkfifo(end)
    step = f"setup.step('a step', ['sh', '-c', ': > {begun}; : < {end}'], log=None)"
    program = f"from deploy.commands import setup\nwith setup.alone(): {step}"
    killed = subprocess.Popen([sys.executable, "-c", program], cwd=checkout, stdout=subprocess.DEVNULL)
    begun.read_bytes()
    killed.kill()
    killed.wait()
    directory = os.open(checkout, os.O_RDONLY)
    try:
        with pytest.raises(BlockingIOError):
            fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
        end.write_bytes(b"")
        fcntl.flock(directory, fcntl.LOCK_EX)  # the next set-up waits for the end of the step
    finally:
        os.close(directory)
