"""The program in C on Cyclone DDS: what the same work costs without any Python (``c/peer.c``)."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from deploy.benchmarks.link import REPORTS, Job
from deploy.supervision.processes import run_directory

_SOURCES = Path(__file__).with_name("c")
_CONFIGURATION = Path(__file__).with_name("links") / "loopback.xml"
_PACKAGES = {"cc": "gcc libc6-dev", "idlc": "cyclonedds-tools cyclonedds-dev"}
"""What compiles it, and the packages of Debian and Ubuntu that bring it."""


def build() -> str:
    """Compile the program; return why that is not possible here, '' if it is."""
    absent = [packages for tool, packages in _PACKAGES.items() if not shutil.which(tool)]
    if absent:
        return f"apt-get install {' '.join(absent)}"
    _program().parent.mkdir(parents=True, exist_ok=True)
    for command in (
        ["idlc", str(_SOURCES / "octets.idl")],
        ["cc", "-O2", "-I.", "-o", str(_program()), str(_SOURCES / "peer.c"), "octets.c", "-lddsc"],
    ):
        done = subprocess.run(
            command, cwd=_program().parent, capture_output=True, text=True, start_new_session=True
        )
        if done.returncode:
            return (done.stderr.strip().splitlines() or [f"{command[0]} failed"])[0]
    return ""


def command(job: Job) -> list[str]:
    """Return the command of a process."""
    numbers = (job.size, job.rate, job.warm_up, job.seconds, job.depth)
    reports = f"{job.directory}/{REPORTS}"
    return [str(_program()), job.role, job.topic, *map(str, numbers), reports, _CONFIGURATION.read_text()]


def _program() -> Path:
    return run_directory() / "bench" / "c" / "peer"
