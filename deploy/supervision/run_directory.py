"""The run directory of a system: its logs, its parameter file, the address of its page."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from deploy.supervision import ownership, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.lock import held

# `make stop` runs without .venv: YAML is imported where it is needed.

SETTINGS = "settings"  # in the run directory: where services keep the values that were set by hand
MEMORY = Path("/dev/shm")  # where files are in memory: the drive keeps its time 25 times a second
PAGE_FILE = "page.txt"  # in the settings: the line with the address of the page
ROS_LOGS = "logs/ros"  # in the run directory: log files of a user's program that is no service
RECORDS = "records"  # in the run directory
STOP_RECORD = "stop-"  # begins the name of the record of a stop
PARAMETERS = "parameters.yaml"  # in the run directory: the ROS parameter file of all services
MANIFEST = "supervisord.conf"  # in the run directory: the manifest of a system, if that is not ours
ALL, KEY = "/**", "ros__parameters"  # the form of ROS 2's parameter files
RUN = 20 * "-"  # begins the line between two runs in a log
NOT_YET = -1.0  # scenario_epoch: the scenario waits until this parameter is set
LEAD = 10.0  # s until the scenario begins where nothing waits for the services


class RunDirectory:
    def __init__(self, run: Path | None = None) -> None:
        """Raise DeploymentError if another user can write in it, or put another one in its place.

        :param run: the directory; by default that of this checkout.
        """
        self.run = run or processes.run_directory()
        ownership.check(run or processes.given_run_directory())

    @property
    def logs(self) -> Path:
        return self.run / "logs"

    @property
    def parameters(self) -> Path:
        """The ROS parameter file of all services; written at each start, removed by an orderly end."""
        return self.run / PARAMETERS

    @property
    def page(self) -> str:
        """The line with the address of the page, or why there is none; empty if it is switched off."""
        with suppress(OSError):
            return (self.run / SETTINGS / PAGE_FILE).read_text(encoding="ascii").strip()
        return ""

    @property
    def is_wanted(self) -> bool:
        """Whether the system was started and not stopped since."""
        return self.parameters.exists()

    def part_logs(self) -> None:
        """Write a line into each log, between the last run and the next one; remove those that only grow."""
        shutil.rmtree(self.run / ROS_LOGS, ignore_errors=True)
        for path in self.logs.glob("*.log"):
            with suppress(OSError), path.open("ab") as log:  # a full disk
                if log.tell():
                    log.write(f"{RUN} {datetime.now():%Y-%m-%d %H:%M:%S} {RUN}\n".encode())

    def forget_settings(self, programs: Sequence[str]) -> None:
        """Begin without settings, with an empty file for each program; in memory, if it may hold files.

        A service that starts late and finds its file is no successor that has lost what was set by hand.
        """
        self.remove_settings()
        directory = self.run / SETTINGS
        make_directory(self.run, 0o700)
        try:
            directory.symlink_to(mkdtemp(prefix="reactive-arm-", dir=MEMORY))
        except OSError:
            make_directory(directory)
        for program in programs:
            with suppress(OSError):  # a full disk: the service makes it, and reports what it cannot keep
                (directory / f"{program}.yaml").write_text("{}\n")

    def remove_settings(self) -> None:
        """Remove the settings, as far as that is possible."""
        directory = self.run / SETTINGS
        if directory.is_symlink():
            if (target := directory.resolve()).parent == MEMORY:
                shutil.rmtree(target, ignore_errors=True)
            with suppress(OSError):
                directory.unlink()
        shutil.rmtree(directory, ignore_errors=True)

    def write_parameters(self, parameters: Mapping[str, object]) -> None:
        """Write the parameter file; services read the old one or the new one."""
        import ros_yaml

        new = self.parameters.with_suffix(".new")
        try:
            new.write_text(ros_yaml.dump(dict(parameters)))
            os.replace(new, self.parameters)
        except ros_yaml.YamlError as error:
            raise DeploymentError(f"{self.parameters}: {error}") from error
        except OSError as error:  # which names no file on a full disk
            raise DeploymentError(f"{self.parameters}: {error.strerror}") from error

    def origin(self) -> float:
        """The origin of the running system's scenario [s, monotonic clock]; NOT_YET before it begins."""
        return float(self.written_parameters()[ALL][KEY]["scenario_epoch"])

    def keep_origin(self, origin: float) -> None:
        """Write the origin of the scenario [s, monotonic clock] for services that start from now on."""
        document = self.written_parameters()
        document[ALL][KEY]["scenario_epoch"] = origin
        self.write_parameters(document)

    def written_parameters(self) -> dict[str, Any]:
        import ros_yaml

        try:
            document: dict[str, Any] = ros_yaml.read(self.parameters)
            document[ALL][KEY]["scenario_epoch"]
        except (OSError, ValueError, LookupError, TypeError):
            reason = "was deleted or damaged: make stop, make start"
            raise DeploymentError(f"{self.parameters} {reason}") from None
        return document

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the logs: only one start or stop at a time. supervisord holds the run directory."""
        make_directory(self.run, 0o700)
        ownership.check(self.run)  # another user was perhaps faster
        make_directory(self.logs)
        with held(self.logs, "start or stop"):
            yield


def make_directory(path: Path, mode: int = 0o777) -> None:
    """Make the run directory or one in it, unless it exists. Raises DeploymentError."""
    try:
        path.mkdir(mode, parents=True, exist_ok=True)
    except OSError as error:
        raise DeploymentError(
            f"The run directory {path} cannot be made: {error.strerror}."
            f" Set {processes.RUN_DIRECTORY} to another one."
        ) from None


def with_parameters(parameters: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of two parameter files in one: the given values count."""
    return {
        node: {KEY: parameters.get(node, {KEY: {}})[KEY] | given.get(node, {KEY: {}})[KEY]}
        for node in {**parameters, **given}
    }


def scenario_parameters(
    scenario: Path | str, origin: float, settings: str | Path = SETTINGS
) -> dict[str, Any]:
    """The parameters that all services share, as the content of a ROS parameter file.

    :param scenario: its file, '' for none.
    :param origin: of the scenario [s, monotonic clock], or NOT_YET.
    :param settings: the folder of what is set by hand; by default in the run directory.
    """
    shared = {"scenario": str(scenario), "scenario_epoch": origin, "settings": str(settings)}
    return {ALL: {KEY: shared}}
