"""Brings .venv up to date: the requirements of the system and its tests and, without ROS 2, deploy/runtime.

It runs on the bare interpreter, before anything is installed. Stamps in .venv record its sources.
Where the right stamp is missing (older requirements, another interpreter, ROS 2 sourced since, an
interrupted set-up) .venv is made anew: half an installation never counts as one. The distributions of this
repository have stamps of their own, so a change in them takes only a second.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import FrameType

from deploy.supervision.processes import ROOT, run_directory, using

VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
STAMP = VENV / "made-from"
LOG = VENV / "setup.log"
REQUIREMENTS = ROOT / "deploy" / "requirements"
PIP = [str(PYTHON), "-m", "pip", "install", "--no-deps", "--no-input", "--progress-bar=off"]
REACTIVE_NODE = ROOT / "interfaces" / "reactive_node"
RUNTIME = ROOT / "deploy" / "runtime"
TOOLS = ROOT / "deploy" / "tools"


class SetupError(Exception):
    """Why .venv could not be made; a message for the user."""


def main() -> int:
    """Make .venv unless it is up to date; the exit code."""
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup asks for this
        signal.signal(signal.SIGHUP, _interrupt)
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # make blocks it until here
        with _alone():
            began = time.monotonic()
            ros = system_rclpy()
            venv_missing = _update(STAMP, fingerprint(ros), partial(make, ros))
            for distribution in (REACTIVE_NODE, *([] if ros else [RUNTIME, TOOLS])):
                stamp = VENV / f"made-from-{distribution.name}"
                _update(stamp, fingerprint_of(distribution), partial(install, distribution, stamp))
            if venv_missing:
                print(f"Set up in {time.monotonic() - began:.0f} s.", flush=True)
    except SetupError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:  # no space, no permission
        print(f"Set-up failed: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback from an interpreter that ends
    return 0


def system_rclpy() -> str:
    """The file of the rclpy of a sourced ROS 2; '' without ROS 2."""
    spec = importlib.util.find_spec("rclpy")
    origin = (spec and spec.origin) or ""
    return "" if Path(origin).is_relative_to(ROOT) else origin


def fingerprint(ros: str) -> str:
    """The digest of everything that .venv is made from; `ros` is the file of ROS 2's rclpy."""
    sources = [*sorted(REQUIREMENTS.glob("*.txt")), Path(__file__)]
    return _digest(sources, sys.version, os.path.realpath(sys.executable), str(VENV), ros)


def fingerprint_of(distribution: Path) -> str:
    """The digest of the files that are installed of a distribution, without those of tools and builds."""
    made = ("__pycache__", "egg-info")
    sources = (path for path in (distribution / "src").rglob("*") if path.is_file())
    kept = (path for path in sources if not any(part.endswith(made) for part in path.parts))
    return _digest([distribution / "pyproject.toml", *distribution.glob("hatch_build.py"), *sorted(kept)])


def _digest(files: Iterable[Path], *words: str) -> str:
    digest = hashlib.sha256(repr(words).encode())
    for file in files:
        content = file.read_bytes()
        digest.update(f"{file.relative_to(ROOT)} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


def _update(stamp: Path, fingerprint: str, make: Callable[[], None]) -> bool:
    """Call `make` unless the stamp has this fingerprint; whether it was called."""
    if stamp.exists() and stamp.read_text() == fingerprint:
        return False
    try:
        make()
    except KeyboardInterrupt:
        print("\nSet-up interrupted; the next make starts it anew.", file=sys.stderr)
        raise
    stamp.write_text(fingerprint)
    return True


def make(ros: str) -> None:
    """Make .venv from nothing; with ROS 2 (the file of its rclpy) it includes the system's packages."""
    _refuse_while_running()
    version = ".".join(map(str, sys.version_info[:3]))
    if importlib.util.find_spec("ensurepip") is None:  # a separate package on Debian and Ubuntu
        package = f"python{sys.version_info[0]}.{sys.version_info[1]}-venv"
        raise SetupError(f"Python {version} ({sys.executable}) lacks ensurepip: apt-get install {package}")
    if ros:
        messages = ("diagnostic_msgs", "geometry_msgs", "sensor_msgs", "std_msgs", "tf2_msgs")
        needed = f"import rclpy, {', '.join(f'{package}.msg' for package in messages)}"
        check = subprocess.run([sys.executable, "-c", needed], capture_output=True, text=True)
        if check.returncode:
            raise SetupError(
                f"ROS 2 is sourced, but its rclpy ({ros}) or message packages do not work with"
                f" {sys.executable}: {check.stderr.strip().splitlines()[-1]}\n"
                "Choose its interpreter (make setup PYTHON=/usr/bin/python3), install what is missing, or"
                " use a shell without ROS 2"
            )
    print(f"Setting up .venv with Python {version}, once; this takes about half a minute.", flush=True)
    STAMP.unlink(missing_ok=True)  # no sooner: a refused set-up leaves the old .venv usable
    venv = [sys.executable, "-m", "venv", "--clear", *(["--system-site-packages"] if ros else []), str(VENV)]
    _step("a virtual environment", venv, log=None)
    files = ["system.txt", "build.txt", "develop.txt", *([] if ros else ["runtime.txt"])]
    _step(
        "packages from PyPI", [*PIP, *(word for name in files for word in ("-r", str(REQUIREMENTS / name)))]
    )
    for tool in ("supervisord", "supervisorctl"):  # pip's own scripts fail in a path with quotes
        (VENV / "bin" / tool).write_text(f'#!/bin/sh\nexec "${{0%/*}}/python" -m supervisor.{tool} "$@"\n')
    if ros:
        print(f"  rclpy of ROS 2: {Path(ros).parent}")


def install(distribution: Path, stamp: Path) -> None:
    """Install a distribution of this repository into .venv, or install it again."""
    _refuse_while_running()
    stamp.unlink(missing_ok=True)
    command = [*PIP, "--no-build-isolation", "--force-reinstall", str(distribution)]
    why = ", as this machine has no ROS 2" if distribution == RUNTIME else ""
    _step(f"{distribution.relative_to(ROOT)}{why}", command)


def _refuse_while_running() -> None:
    for run in using(PYTHON.parent):
        elsewhere = "" if run == run_directory() else f"REACTIVE_ARM_RUN_DIR={shlex.quote(str(run))} "
        raise SetupError(f"A running system uses this .venv. Stop it before the set-up: {elsewhere}make stop")


def _step(title: str, command: list[str], log: Path | None = LOG) -> None:
    """Run a command; show its title and, on a terminal, pip's progress. Raises SetupError with its errors."""
    live = sys.stdout.isatty()
    print(f"  {title}", end="" if live else "\n", flush=True)
    lines: list[str] = []
    environment = os.environ | {"PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    # A signal waits until the command can be ended.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    process = subprocess.Popen(
        command,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,  # the children of venv and pip end with it
        preexec_fn=partial(signal.pthread_sigmask, signal.SIG_SETMASK, mask),
    )
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            words = line.split()
            if live and words[:1] in (["Collecting"], ["Installing"], ["Building"]):
                print(f"\r\x1b[K  {title}: {words[0].lower()} {words[1]}", end="", flush=True)
        process.wait()
    except BaseException:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.communicate()  # returns when the last child has ended
        raise
    finally:
        if live:
            print(f"\r\x1b[K  {title}", flush=True)
        if log is not None and log.parent.exists():
            with log.open("a") as file:
                file.writelines(lines)
    if process.returncode:
        reasons = [line for line in lines if line.startswith("ERROR")] or lines[-5:]
        if any("Retrying" in line for line in lines):  # pip then blames the requirement
            reasons.append("The package index was not reached: network, proxy, PIP_INDEX_URL?")
        where = f" (full log: {log.relative_to(ROOT)})" if log is not None else ""
        raise SetupError(f"Set-up failed at {title}{where}:\n{''.join(reasons).rstrip()}")


@contextmanager
def _alone() -> Iterator[None]:
    """Hold the lock of this checkout's set-up: a second make waits for the first."""
    directory = os.open(ROOT, os.O_RDONLY)
    try:
        try:
            fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("Waiting for another make to finish its set-up.", flush=True)
            fcntl.flock(directory, fcntl.LOCK_EX)
        yield
    finally:
        os.close(directory)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
