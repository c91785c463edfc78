"""The compared alternatives, and how their processes are started."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from deploy.supervision.processes import ROOT
from deploy.supervision.rclpy_choice import CYCLONEDDS, RUNTIME
from tests.benchmarks import c_program
from tests.benchmarks.link import HEARTBEATS, Job

PYTHON = ROOT / "deploy" / "commands" / "venv.sh"
_CHECK = """
import os, sys
if bool(os.environ.get("RCLPY_GROUND")) == {ros}:
    sys.exit("rclpy stands on {other} here")
import tests.benchmarks.links.{link}
"""

Commands = Callable[["Alternative", Sequence[Job]], list[list[str]]]


def processes(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return a command for each job, which goes to a file."""
    files = [Path(job.directory, f"{job.role}.json") for job in jobs]
    for job, file in zip(jobs, files, strict=True):
        file.write_text(json.dumps(asdict(job)))
    return [[str(PYTHON), "-m", "tests.benchmarks.worker", str(file)] for file in files]


def services(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return a command for each job; Python would be too slow as the source of heartbeats."""
    *others, source = jobs
    if source.topic != HEARTBEATS:
        return processes(alternative, jobs)
    return [*processes(alternative, others), c_program.command(c_program.SERVICES, source)]


def c_processes(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return a command of a program in C for each job."""
    return [c_program.command(alternative.link, job) for job in jobs]


@dataclass(frozen=True)
class Alternative:
    title: str
    link: str
    """The module of :mod:`tests.benchmarks.links`, or the program of :mod:`tests.benchmarks.c_program`."""
    ros: bool = False
    """Whether rclpy stands on the middleware of ROS 2, else on Cyclone DDS."""
    commands: Commands = processes
    build: Callable[[], str] | None = None
    """Compiles its program, and returns why that is not possible here; none if it is in Python."""

    @property
    def environment(self) -> dict[str, str]:
        paths = filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))
        return os.environ | {"PYTHONPATH": os.pathsep.join(paths), RUNTIME: "" if self.ros else CYCLONEDDS}

    def missing(self) -> str:
        """Return why it cannot be measured here; '' if it can."""
        if self.build:
            return self.build()
        other = "Cyclone DDS" if self.ros else "the middleware of ROS 2"
        command = [str(PYTHON), "-c", _CHECK.format(ros=self.ros, other=other, link=self.link)]
        done = subprocess.run(
            command, env=self.environment, capture_output=True, text=True, start_new_session=True
        )
        return (done.stderr.strip().splitlines() or ["it cannot be imported"])[-1] if done.returncode else ""


ALTERNATIVES = (
    Alternative("ReactiveNode", "reactive"),
    Alternative("callbacks, same rclpy", "callbacks"),
    Alternative("rxros2 style, same rclpy", "rxros2"),
    Alternative("ROS 2, ReactiveNode", "reactive", ros=True),
    Alternative("ROS 2, callbacks", "callbacks", ros=True),
    Alternative("ROS 2, callbacks on EventsExecutor", "callbacks_events", ros=True),
    Alternative("ROS 2, rxros2 style", "rxros2", ros=True),
    Alternative("Cyclone DDS, C program", c_program.PIPELINE, commands=c_processes, build=c_program.build),
)
CHAINS = (
    Alternative("services", "chain_services", commands=services),
    Alternative("RxPY operators on callbacks, same rclpy", "chain_operators", commands=services),
    Alternative("callbacks, same rclpy", "chain", commands=services),
    Alternative("ROS 2, services", "chain_services", ros=True, commands=services),
    Alternative("ROS 2, callbacks", "chain", ros=True, commands=services),
    Alternative("ROS 2, callbacks on EventsExecutor", "chain_events", ros=True, commands=services),
    Alternative("Cyclone DDS, C program", c_program.SERVICES, commands=c_processes, build=c_program.build),
)
"""The arm's own chain, from an angle to a speed, and its operator watchdog."""
