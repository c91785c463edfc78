"""The environment of the embedded rclpy, .venv-bench: made on first use, apart from the system's .venv."""

from __future__ import annotations

import hashlib
import subprocess
import sys

from deploy.benchmarks.alternatives import BENCH_PYTHON
from deploy.running import interruption
from deploy.running.processes import ROOT

_FILES = [ROOT / "deploy/requirements/system.txt", ROOT / "deploy/requirements/embedded.txt"]
_VENV = BENCH_PYTHON.parents[1]
_STAMP = _VENV / "made-from"


class EnvironmentFailed(Exception):
    """Why the environment could not be made; a message for the user."""


def prepare() -> None:
    """
    Make the environment if it is missing or outdated.

    :raises EnvironmentFailed: if pip refuses a file of requirements.
    """
    contents = b"".join(file.read_bytes() for file in _FILES)
    fingerprint = hashlib.sha256(sys.version.encode() + contents).hexdigest()
    if _STAMP.exists() and _STAMP.read_text() == fingerprint:
        return
    print(f"Setting up {_VENV.name}, once; this takes about a minute.", flush=True)
    _run([sys.executable, "-m", "venv", "--clear", str(_VENV)])
    # Isolated: pip takes what a sourced ROS 2 has on its path for installed.
    pip = [str(BENCH_PYTHON), "-I", "-m", "pip", "install", "--no-deps", "--no-input", "--quiet"]
    _run([*pip, "--disable-pip-version-check", *(word for file in _FILES for word in ("-r", str(file)))])
    _STAMP.write_text(fingerprint)


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    interruption.check()  # Ctrl-C has ended the command
    if done.returncode:
        lines = [*done.stdout.splitlines(), *done.stderr.splitlines()]
        reasons = [line for line in lines if line.startswith("ERROR")] or lines[-1:] or ["no reason given"]
        raise EnvironmentFailed(reasons[0].removeprefix("ERROR: "))
