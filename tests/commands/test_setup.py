"""The set-up of .venv where it fails, in a checkout of its own."""

from __future__ import annotations

import ensurepip
import fcntl
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from deploy.commands import setup
from deploy.supervision.processes import ROOT

STAMP = ".venv/made-from"


def set_up(checkout: Path, **environment: str) -> tuple[int, str]:
    """Set a checkout up: the exit code and the errors."""
    done = subprocess.run(
        [sys._base_executable, "-m", "deploy.commands.setup"],
        cwd=checkout,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=150,
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


def test_a_venv_in_which_a_process_runs_is_kept(checkout: Path) -> None:
    python = checkout / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.symlink_to(os.path.realpath(sys._base_executable))
    command = [".venv/bin/python", "-c", "print()\ninput()"]  # as venv.sh calls it
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, cwd=checkout, **pipes) as process:
        assert process.stdout is not None
        process.stdout.readline()
        code, errors = set_up(checkout, RUNTIME="")
        process.communicate(b"\n")
    words = f"Process {process.pid} uses this .venv. Await its end before the set-up: "
    assert (code, errors) == (1, f"{words}.venv/bin/python -c print() input()\n")
    assert python.is_symlink()


def test_the_interpreter_is_none_of_an_interrupted_set_up(checkout: Path) -> None:
    python = checkout / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.symlink_to(os.path.realpath(sys._base_executable))  # there is no pyvenv.cfg
    (checkout / "show.py").write_text("import sys; print(sys.executable)")
    shown = subprocess.run(
        ["deploy/commands/python.sh", "show"], cwd=checkout, capture_output=True, text=True
    )
    assert shown.stdout == f"{python.readlink()}\n"


def test_a_closed_standard_input_stops_no_command(checkout: Path) -> None:
    (checkout / "show.py").write_text("import sys; print(sys.stdin.read())")
    folder = os.open(checkout, os.O_RDONLY)  # as make may leave it
    command = ["deploy/commands/python.sh", "show"]
    shown = subprocess.run(command, cwd=checkout, stdin=folder, capture_output=True, text=True)
    os.close(folder)
    assert (shown.stdout, shown.stderr) == ("\n", "")


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


@pytest.mark.parametrize(
    ("python", "problem"),
    [
        ("it's", ": there is no such program"),  # a quote is no shell syntax
        ("/nowhere/python3", ": there is no such program"),
        ("/bin/false", " is not a Python 3.11 to 3.14"),
    ],
)
def test_a_python_that_cannot_be_used_is_refused(checkout: Path, python: str, problem: str) -> None:
    done = subprocess.run(["make", "stop", f"PYTHON={python}"], cwd=checkout, capture_output=True, text=True)
    assert done.stderr.splitlines()[:-1] == [f"PYTHON={python}{problem}"]


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
def test_a_step_that_fails_on_a_full_disk_reports_the_free_space(
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


def test_a_set_up_names_its_pip_and_checks_the_hashes_of_all_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[tuple[str, list[str]]] = []
    monkeypatch.setattr(setup, "step", lambda title, command, **_: steps.append((title, command)))
    monkeypatch.setattr(setup, "VENV", tmp_path)
    monkeypatch.setattr(setup, "STAMP", tmp_path / "made-from")
    monkeypatch.setattr(setup, "_refuse_while_running", lambda: None)
    (tmp_path / "bin").mkdir()
    Path(sysconfig.get_path("purelib", "venv", {"base": str(tmp_path)})).mkdir(parents=True)
    setup.make("")
    (title, _), *by_pip = steps
    assert title == f"a virtual environment with pip {ensurepip.version()}"
    assert all("--require-hashes" in command for _, command in by_pip)
    installed = [Path(word).name for _, command in by_pip for word in command if word.endswith(".txt")]
    assert installed == ["system.txt", "build.txt", "develop.txt", "ros.txt", "cyclonedds.txt"]
    # PyPI has no Cyclone DDS for the newest Python, and its C library works with any.
    assert ("--python-version=3.13" in by_pip[-1][1]) == (sys.version_info >= (3, 14))
