"""The programs in C on Cyclone DDS: what the same work costs without any Python (``c/``)."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from deploy.supervision.processes import run_directory
from tests.benchmarks.link import HEARTBEATS, Job

PIPELINE, SERVICES = "pipeline", "services"
LOOPBACK, LOCALHOST = "loopback.xml", "localhost.xml"  # the settings of the ground of Cyclone DDS
_SOURCES = Path(__file__).with_name("c")
_CONFIGURATIONS = Path(__file__).with_name("links")
_PACKAGES = {"cc": "gcc libc6-dev", "idlc": "cyclonedds-tools cyclonedds-dev"}
"""The compiler, and the packages of Debian and Ubuntu that bring it."""


def build() -> str:
    """Compile the programs; return why that is not possible here, '' if it is."""
    absent = [packages for tool, packages in _PACKAGES.items() if not shutil.which(tool)]
    if absent:
        return f"apt-get install {' '.join(absent)}"
    directory = _directory()
    directory.mkdir(parents=True, exist_ok=True)
    for name in (PIPELINE, SERVICES):
        sources = [str(_SOURCES / f"{name}.c"), str(_SOURCES / "process.c"), f"{name}.c"]
        with TemporaryDirectory(dir=directory) as build:  # another process may build or run them now
            for command in (
                ["idlc", str(_SOURCES / f"{name}.idl")],
                ["cc", "-O2", "-I.", f"-I{_SOURCES}", "-o", name, *sources, "-lddsc", "-lm"],
            ):
                done = subprocess.run(
                    command, cwd=build, capture_output=True, text=True, start_new_session=True
                )
                if done.returncode:
                    return (done.stderr.strip().splitlines() or [f"{command[0]} failed"])[0]
            (Path(build) / name).replace(directory / name)
    return ""


def command(program: str, job: Job) -> list[str]:
    """Return the command of a process of PIPELINE or SERVICES."""
    numbers = (job.size, job.rate, job.warm_up, job.seconds, job.depth)
    configuration = _CONFIGURATIONS / (LOCALHOST if job.topic == HEARTBEATS else LOOPBACK)
    words = [job.role, job.topic, *map(str, numbers), job.directory, configuration.read_text()]
    return [str(_directory() / program), *words]


def _directory() -> Path:
    return run_directory() / "bench" / "c"
