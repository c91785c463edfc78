"""The environment of the alternatives, .venv-bench: made on first use, apart from the system's .venv."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

from deploy.benchmarks.alternatives import BENCH_PYTHON
from deploy.running import interruption
from deploy.running.processes import ROOT

CHART = "chart.txt"
_REQUIREMENTS = Path(__file__).with_name("requirements")
_RUNTIME = [ROOT / "deploy/requirements/system.txt", ROOT / "deploy/requirements/embedded.txt"]
_VENV = BENCH_PYTHON.parents[1]
_STAMP = _VENV / "made-from"


class EnvironmentFailed(Exception):
    """Why the environment could not be made; a message for the user."""


def prepare(names: Collection[str]) -> dict[str, str]:
    """
    Make the environment if it is missing or outdated.

    :param names: files of requirements; each may fail for itself.
    :return: why pip refused a file, by its name.
    """
    files = [*_RUNTIME, *sorted(_REQUIREMENTS.glob("*.txt"))]
    hashed = hashlib.sha256(sys.version.encode() + b"".join(file.read_bytes() for file in files))
    fingerprint = hashed.hexdigest()
    made_from = _STAMP.read_text().split() if _STAMP.exists() else []
    installed = made_from[1:] if made_from[:1] == [fingerprint] else None
    if installed is not None and set(names) <= set(installed):
        return {}
    print(f"Setting up {_VENV.name} with the alternatives, once; this takes about a minute.", flush=True)
    if installed is None:
        _run([sys.executable, "-m", "venv", "--clear", str(_VENV)])
        for file in _RUNTIME:
            _install(file)
        installed = []
    refused = {}
    for name in names:
        if name in installed:
            continue
        try:
            _install(_REQUIREMENTS / name)
            installed.append(name)
        except EnvironmentFailed as error:
            refused[name] = str(error)  # the next run tries again
    _STAMP.write_text(" ".join([fingerprint, *installed]))
    return refused


def _install(file: Path) -> None:
    # Isolated: pip takes what a sourced ROS 2 has on its path for installed.
    pip = [str(BENCH_PYTHON), "-I", "-m", "pip", "install", "--no-deps", "--no-input", "--quiet"]
    _run([*pip, "--disable-pip-version-check", "-r", str(file)])


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    interruption.check()  # Ctrl-C has ended the command
    if done.returncode:
        lines = [*done.stdout.splitlines(), *done.stderr.splitlines()]
        reasons = [line for line in lines if line.startswith("ERROR")] or lines[-1:] or ["no reason given"]
        raise EnvironmentFailed(reasons[0].removeprefix("ERROR: "))
