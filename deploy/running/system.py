"""The running system of a checkout: supervisord, its programs and their runtime files."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from deploy.running import interruption, manifest, processes, rpc

# `make stop` runs without .venv: PyYAML is imported where it is needed.

SERVICE_GRACE = 1.0  # s from SIGTERM to SIGKILL of a service, as in supervisord.conf
SUPERVISOR_GRACE = 1.4  # s that supervisord has to stop all of them
OBEY_LIMIT = 0.4  # s that supervisord has to accept a shutdown; all of it ends within 2 s
ANSWER_LIMIT = 1.5  # s that supervisord has to answer the sentinel
READY_LIMIT = 20.0  # s that supervisord has to answer its first call
NAMESPACE = "REACTIVE_ARM_NAMESPACE"  # environment variable: the ROS namespace of an arm
SETTINGS = "settings"  # in the run directory: where services keep the values that were set by hand
PAGE_FILE = "page.txt"  # in the settings: the line that tells the address of the page
PARAMETERS = "parameters.yaml"  # in the run directory: the ROS parameter file of all services
ALL, KEY = "/**", "ros__parameters"  # the form of ROS 2's parameter files
FASTDDS_PROFILES = Path(__file__).resolve().parents[1] / "fastdds.xml"
NOT_YET = -1.0  # scenario_epoch: the scenario waits until this parameter is set


class DeploymentError(Exception):
    """Why the system cannot be started, stopped or asked; one line for the user."""


class Program(NamedTuple):
    """A supervised program as supervisord sees it."""

    name: str
    state: str
    """STOPPED, STARTING, RUNNING, BACKOFF, STOPPING, EXITED, FATAL or UNKNOWN"""
    pid: int
    """0 when no process runs"""
    uptime: float
    """[s] since its process was started; 0 when none runs"""
    restarts: int
    """how often it was started again since the system was started"""
    exit: str
    """how its last process ended, in words; '' before the first end"""
    error: str
    """supervisord's words about the last start or end"""


class System:
    """The system whose runtime files lie in one run directory, whether it runs or not."""

    def __init__(self, run: Path | None = None, within: Sequence[str] = ()) -> None:
        """:param within: a command in front of supervisord's own, such as `ip netns exec NAME`"""
        self.run = run or processes.run_directory()
        self._within = within
        self._supervisor: int | None = None  # a pidfd
        self._environment = dict(os.environ)

    @property
    def logs(self) -> Path:
        """The directory of the programs' logs."""
        return self.run / "logs"

    @property
    def parameters(self) -> Path:
        """The ROS parameter file of all services; written at each start, removed by an orderly end."""
        return self.run / PARAMETERS

    @property
    def page(self) -> str:
        """The line that tells the address of the page, or why there is none; empty if it is switched off."""
        with suppress(OSError):
            return (self.run / SETTINGS / PAGE_FILE).read_text(encoding="ascii").strip()
        return ""

    @property
    def is_wanted(self) -> bool:
        """Whether the system was started and not stopped since."""
        return self.parameters.exists()

    def unattended(self) -> str:
        """The message about services that live without supervisord."""
        return (
            f"supervisord has died; {len(self.members())} services go on without it in {self.run}.\n"
            "make start replaces them, make stop ends them."
        )

    def how_it_ended(self) -> str:
        """The message about the end of supervisord, by a stop or by an accident."""
        return self.unattended() if self.is_wanted else "The system has ended."

    def silent_end(self) -> str:
        """The reason of a program that gave none: it may have no place for its words."""
        free = shutil.disk_usage(self.run).free
        return f"It gave no reason; {free / 1000:.0f} kB are free on the disk of {self.run}"

    def members(self) -> list[processes.Process]:
        """The live processes of the system, and those that a dead supervisord left behind."""
        return processes.of_system(self.run)

    def supervisor(self) -> int | None:
        """The pid of the running supervisord."""
        return next((process.pid for process in self.members() if not process.program), None)

    def environment(self) -> dict[str, str]:
        """The environment that the running system was started with; empty when none runs."""
        return next((processes.environment_of(process.pid) for process in self.members()), {})

    # Start and stop

    def start(self, parameters: Mapping[str, object]) -> None:
        """Start supervisord with its programs, all with these parameters (content of a ROS parameter file).

        The orphans of a killed supervisord are ended first: no service lives twice. Returns as soon as
        supervisord answers. Raises DeploymentError when a system runs already.
        """
        with self._alone():
            self._environment = dict(os.environ)  # also for `start_again`
            self._prepare(parameters)
            self._start_supervisor()

    def start_again(self) -> bool:
        """Start the system as it was after supervisord died; False if it was stopped on purpose."""
        with self._alone():
            if not self.is_wanted:
                return False
            if self.supervisor():
                self._supervisor = None  # another terminal has started it meanwhile
            else:
                self._start_supervisor()
            return True

    def become_supervisord(self, parameters: Mapping[str, object], arguments: Sequence[str]) -> NoReturn:
        """Start as `start` does, but replace this process by supervisord with these arguments."""
        with self._alone():
            self._prepare(parameters)
            self._end_members()
            os.chdir(self.run)
            os.umask(0o077)
            command = [sys.executable, "-m", "supervisor.supervisord", *arguments]
            os.execve(sys.executable, command, self._supervisor_environment())

    def supervisor_has_ended(self) -> bool:
        """Whether the supervisord has ended that was started here, or that ran at the first call."""
        if self._supervisor is None:
            pid = self.supervisor()
            if pid is None:
                return True
            self._supervisor = os.pidfd_open(pid)
        return not processes.await_end([self._supervisor], 0.0)

    def stop(self, tell: Callable[[int], None] = lambda count: None) -> int:
        """End every process of the system, with supervisord's help or without.

        :param tell: is called with their number before they are ended
        :return: their number
        """
        if not self.logs.exists() and not self.members():
            tell(0)
            return 0
        with self._alone():
            count = len(self.members())
            tell(count)
            with suppress(OSError):  # a read-only checkout
                self.parameters.unlink()  # a terminal that guards the system does not start it again
            if pid := self.supervisor():
                handles = processes.open_handles(self.run, [p.pid for p in self.members()])
                with suppress(rpc.NoAnswer):  # it hangs or dies just now
                    rpc.call(pid, "supervisor.shutdown", timeout=OBEY_LIMIT)
                    processes.await_end(handles, SUPERVISOR_GRACE)
                processes.close(handles)
            self._end_members()
        return count

    # Questions to supervisord

    def programs(self) -> list[Program]:
        """All programs as supervisord sees them. Raises DeploymentError when it does not answer."""
        pid = self.supervisor()
        if pid is None:
            raise DeploymentError(self.unattended())
        return self._programs(pid, "arm.programs")

    def watch(self, supervisor: int) -> list[Program]:
        """The programs for the sentinel; this call is the sentinel's sign of life."""
        return self._programs(supervisor, "arm.watch", timeout=ANSWER_LIMIT)

    def revive(self, supervisor: int, program: str) -> None:
        """Start a program that supervisord has given up. Raises DeploymentError."""
        name = f"{manifest.GROUP}:{program}"
        self._ask(supervisor, "supervisor.startProcess", name, False, timeout=ANSWER_LIMIT)

    def halt(self, program: str) -> None:
        """Stop a program until the next start of the system. Raises DeploymentError."""
        self._ask(self.supervisor() or 0, "supervisor.stopProcess", f"{manifest.GROUP}:{program}")

    def _programs(self, supervisor: int, method: str, timeout: float = rpc.LIMIT) -> list[Program]:
        answer = self._ask(supervisor, method, timeout=timeout)
        try:
            return [Program(**row) for row in json.loads(answer)]
        except (TypeError, ValueError) as error:  # the user has updated the checkout of a running system
            raise DeploymentError(
                f"supervisord (pid {supervisor}) runs another version of this program: make stop, make start"
            ) from error

    def _ask(self, supervisor: int, method: str, *arguments: object, timeout: float = rpc.LIMIT) -> Any:
        try:
            return rpc.call(supervisor, method, *arguments, timeout=timeout)
        except rpc.NoAnswer as error:
            raise DeploymentError(str(error)) from error

    # The scenario

    def origin(self) -> float:
        """The origin of the running system's scenario [s, monotonic clock]; NOT_YET before it begins."""
        return float(self._written_parameters()[ALL][KEY]["scenario_epoch"])

    def keep_origin(self, origin: float) -> None:
        """Write the origin of the scenario [s, monotonic clock] for services that start from now on."""
        document = self._written_parameters()
        document[ALL][KEY]["scenario_epoch"] = origin
        self.write_parameters(document)

    def _written_parameters(self) -> dict[str, Any]:
        import yaml

        try:
            document: dict[str, Any] = yaml.safe_load(self.parameters.read_text())
            document[ALL][KEY]["scenario_epoch"]
        except (OSError, ValueError, LookupError, TypeError, yaml.YAMLError):
            reason = "was deleted or damaged: make stop, make start"
            raise DeploymentError(f"{self.parameters} {reason}") from None
        return document

    # The steps of start and stop

    def _prepare(self, parameters: Mapping[str, object]) -> None:
        if pid := self.supervisor():
            where = f"supervisord has pid {pid} and works in {self.run}"
            raise DeploymentError(f"Already running: {where}. make terminal shows it, make stop ends it")
        shutil.rmtree(self.run / SETTINGS, ignore_errors=True)
        self.write_parameters(parameters)

    def write_parameters(self, parameters: Mapping[str, object]) -> None:
        """Write the parameter file; services read the old one or the new one."""
        import yaml

        new = self.parameters.with_suffix(".new")
        try:
            new.write_text(yaml.safe_dump(dict(parameters), sort_keys=False))
            os.replace(new, self.parameters)
        except OSError as error:  # which names no file on a full disk
            raise DeploymentError(f"{self.parameters}: {error.strerror}") from error

    def _end_members(self) -> None:
        """End the live processes without supervisord's help."""
        for _ in range(3):  # a process that is being forked shows only in the next round
            left = self.members()
            if not left:
                return
            # supervisord first: it would restart the others.
            processes.end(self.run, [process.pid for process in left if not process.program], 0.0)
            processes.end(self.run, [process.pid for process in left if process.program], SERVICE_GRACE)
        raise DeploymentError(f"These processes do not end: {[process.pid for process in left]}")

    def _start_supervisor(self) -> None:
        self._end_members()
        output = self.logs / "supervisord.out"
        supervisord = [sys.executable, "-m", "supervisor.supervisord", "--nodaemon", "--silent"]
        with output.open("wb") as file:
            process = subprocess.Popen(
                [*self._within, *supervisord, "-c", str(manifest.PATH)],
                cwd=self.run,
                env=self._supervisor_environment(),
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C at the terminal is for the launcher, which stops it in order
                umask=0o077,
            )
        deadline = time.monotonic() + READY_LIMIT
        try:
            while process.poll() is None and time.monotonic() < deadline:
                interruption.check()
                with suppress(rpc.NoAnswer):
                    rpc.call(process.pid, "supervisor.getState")
                    self._supervisor = os.pidfd_open(process.pid)
                    return
                time.sleep(0.02)
            reason = output.read_text(errors="replace").strip()
            raise DeploymentError(f"supervisord does not start:\n{reason or self.silent_end()}")
        except BaseException:
            process.kill()
            process.wait()
            self._end_members()  # the services that it has started already
            raise

    def _supervisor_environment(self) -> dict[str, str]:
        environment = dict(self._environment)
        environment[processes.MARK] = str(self.run)
        environment[NAMESPACE] = namespace_of(environment)
        set_middleware(environment)
        environment["PYTHONUNBUFFERED"] = "1"
        environment["OPENBLAS_NUM_THREADS"] = "1"  # numpy starts no threads: supervisord forks
        _prepend(environment, "PATH", str(Path(sys.executable).parent))
        _prepend(environment, "PYTHONPATH", str(processes.ROOT))
        return environment

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold the logs: only one start or stop at a time. supervisord holds the run directory."""
        make_directory(self.run, 0o700)
        make_directory(self.logs)
        directory = os.open(self.logs, os.O_RDONLY)
        try:
            try:
                fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                with suppress(OSError):  # a closed terminal
                    print("Waiting for another make to end its start or stop.", flush=True)
                with interruption.blocking():
                    fcntl.flock(directory, fcntl.LOCK_EX)
            yield
        finally:
            os.close(directory)


def make_directory(path: Path, mode: int = 0o777) -> None:
    """Make the run directory or one in it, unless it exists. Raises DeploymentError."""
    try:
        path.mkdir(mode, parents=True, exist_ok=True)
    except OSError as error:
        raise DeploymentError(
            f"The run directory {path} cannot be made: {error.strerror}."
            f" Set {processes.RUN_DIRECTORY} to another one."
        ) from None


def scenario_parameters(scenario: Path, origin: float, settings: str | Path = SETTINGS) -> dict[str, object]:
    """The parameters that all services share, as the content of a ROS parameter file.

    :param origin: of the scenario [s, monotonic clock], or NOT_YET.
    :param settings: the folder of what is set by hand; by default in the run directory.
    """
    shared = {"scenario": str(scenario), "scenario_epoch": origin, "settings": str(settings)}
    return {ALL: {KEY: shared}}


def set_middleware(environment: MutableMapping[str, str]) -> None:
    """Set what the nodes of an arm need from the middleware, where the user has not set it."""
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(FASTDDS_PROFILES))
    # In LOCALHOST, rmw_fastrtps_cpp always adds shared memory; there, the profile keeps messages out of it.
    environment.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")


def namespace_of(environment: Mapping[str, str]) -> str:
    """The ROS namespace of the arm in an environment."""
    return environment.get(NAMESPACE) or "/"


def _prepend(environment: dict[str, str], name: str, path: str) -> None:
    rest = environment.get(name)
    environment[name] = f"{path}{os.pathsep}{rest}" if rest else path
