"""The compared alternatives, and how their processes are started."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from deploy.benchmarks import c_program
from deploy.benchmarks.link import HEARTBEATS, Job
from deploy.running.processes import ROOT
from deploy.running.rclpy_choice import RUNTIME

BENCH_PYTHON = ROOT / ".venv-bench" / "bin" / "python"
SYSTEM_PYTHON = ROOT / "deploy" / "commands" / "venv.sh"
_EMBEDDED = [ROOT, ROOT / "interfaces/reactive_node/src", ROOT / "deploy/runtime/src"]
_NEEDS_ROS = (
    "import importlib.util, sys; "
    "importlib.util.find_spec('rosidl_runtime_embedded') and sys.exit('.venv has no rclpy of ROS 2')"
)

Commands = Callable[["Alternative", Sequence[Job]], list[list[str]]]


def job_command(alternative: Alternative, job: Job) -> list[str]:
    """Return the command of a process; its job goes to a file."""
    file = Path(job.directory, f"{job.role}.json")
    file.write_text(json.dumps(asdict(job)))
    return [str(alternative.python), "-m", "deploy.benchmarks.worker", str(file)]


def processes(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return a command for each job."""
    return [job_command(alternative, job) for job in jobs]


def services(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return a command for each job; Python would be too slow as the source of heartbeats."""
    *others, source = jobs
    if source.topic != HEARTBEATS:
        return processes(alternative, jobs)
    return [*processes(alternative, others), c_program.command(c_program.SERVICES, source)]


def c_processes(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return a command of a program in C for each job."""
    return [c_program.command(alternative.link, job) for job in jobs]


def c_processes_with_defaults(alternative: Alternative, jobs: Sequence[Job]) -> list[list[str]]:
    """Return the same commands, with the settings that Cyclone DDS has by itself."""
    return [c_program.command(alternative.link, job, c_program.DEFAULTS) for job in jobs]


@dataclass(frozen=True)
class Alternative:
    """One way to connect three processes."""

    title: str
    link: str
    """The module of :mod:`deploy.benchmarks.links`, or the program of :mod:`deploy.benchmarks.c_program`."""
    ros: bool = False
    """Whether it runs on ROS 2's rclpy: of .venv, or of a sourced ROS 2."""
    commands: Commands = processes
    build: Callable[[], str] | None = None
    """Compiles its program, and returns why that is not possible here; none if it is in Python."""

    @property
    def python(self) -> Path:
        """The interpreter of its processes."""
        return SYSTEM_PYTHON if self.ros else BENCH_PYTHON

    @property
    def environment(self) -> dict[str, str]:
        """The environment of its processes; what is not ROS 2 must not see it."""
        if not self.ros:
            return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, _EMBEDDED))}
        embedded = set(map(str, _EMBEDDED))
        inherited = [
            path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path not in embedded
        ]
        paths = os.pathsep.join([str(ROOT), *filter(None, inherited)])
        return os.environ | {"PYTHONPATH": paths, RUNTIME: ""}

    def missing(self) -> str:
        """Return why it cannot be measured here; '' if it can."""
        if self.build:
            return self.build()
        check = f"import deploy.benchmarks.links.{self.link}"
        if self.ros:
            check = f"{_NEEDS_ROS}; {check}"
        command = [str(self.python), "-c", check]
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
    Alternative("RxPY operators, without rclpy", "chain_dds", commands=services),
    Alternative("ROS 2, services", "chain_services", ros=True, commands=services),
    Alternative("ROS 2, callbacks", "chain", ros=True, commands=services),
    Alternative("ROS 2, callbacks on EventsExecutor", "chain_events", ros=True, commands=services),
    Alternative("Cyclone DDS, C program", c_program.SERVICES, commands=c_processes, build=c_program.build),
)
"""The arm's own chain, from an angle to a speed, and its operator watchdog."""
IMAGES = (
    Alternative("ReactiveNode", "image_reactive"),
    Alternative("callbacks, same rclpy", "image_callbacks"),
    Alternative("ROS 2, ReactiveNode", "image_reactive", ros=True),
    Alternative("ROS 2, callbacks", "image_callbacks", ros=True),
    Alternative(
        "C program, Cyclone DDS's own settings",
        c_program.PIPELINE,
        commands=c_processes_with_defaults,
        build=c_program.build,
    ),
    Alternative(
        "C program, the runtime's settings", c_program.PIPELINE, commands=c_processes, build=c_program.build
    ),
)
"""Images from one process to another. The programs in C send only the octets of the image."""
