"""The running system of a checkout: supervisord, its programs and their runtime files under .run/."""

from __future__ import annotations

import fcntl
import http.client
import os
import shutil
import socket
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, cast

import yaml

from deploy.console.output import say
from deploy.supervision import processes

CONFIGURATION = processes.ROOT / "deploy" / "supervisord.conf"
SERVICE_GRACE = 1.0  # s from SIGTERM to SIGKILL of a service, as in supervisord.conf
SUPERVISOR_GRACE = 1.4  # s that supervisord has to stop all of them
OBEY_LIMIT = 0.4  # s that it has to say that it will; all of it ends within 2 s
ANSWER_LIMIT = 1.5  # s that it has to answer the sentinel
NAMESPACE = "REACTIVE_ARM_NAMESPACE"  # the environment variable that tells of an arm's ROS namespace
SETTINGS = "settings"  # the directory, in that of the system, in which services keep what was set by hand
GROUP = "arm"  # of all programs, in supervisord.conf
READY_GRACE = 20.0  # s that supervisord has to answer its first call
LOCK_INTERVAL = 0.05  # s between two looks whether another start or stop is over

Check = Callable[[], None]
"""Is called often while something is awaited, and raises what is to end that."""


class DeploymentError(Exception):
    """Why the system cannot be started, stopped or asked, in words for the user."""


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
    description: str
    """supervisord's own words on its state"""


class Watched(NamedTuple):
    """A supervised program as the sentinel sees it."""

    name: str
    state: str
    pid: int
    age: float
    """[s] since its process was started"""
    restarts: int
    exit: str
    """how its last process ended, in words; '' before the first end"""
    error: str
    """what supervisord says about the last start or end"""


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
        """Where each program and supervisord write their logs."""
        return self.run / "logs"

    @property
    def parameters(self) -> Path:
        """The ROS parameter file of all services, written at each start."""
        return self.run / "parameters.yaml"

    @property
    def is_wanted(self) -> bool:
        """Whether it was started, and nobody has stopped it since."""
        return self.parameters.exists()

    def unattended(self) -> str:
        """What is told of services that live without supervisord."""
        return (
            f"supervisord has died; {len(self.members())} services go on without it in {self.run}.\n"
            "make start begins anew with them, make stop ends them."
        )

    def members(self) -> list[processes.Process]:
        """The live processes of the system, also those that a dead supervisord left behind."""
        return processes.of_system(self.run)

    def supervisor(self) -> int | None:
        """The pid of the running supervisord."""
        return next((process.pid for process in self.members() if not process.program), None)

    def environment(self) -> dict[str, str]:
        """The environment that the running system was started with; empty when none runs."""
        return next((processes.environment_of(process.pid) for process in self.members()), {})

    def start(self, parameters: Mapping[str, object], check: Check = lambda: None) -> None:
        """Start supervisord with its programs, all with these parameters (content of a ROS parameter file).

        What a killed supervisord left behind is ended first: no service ever lives twice. Returns as soon as
        supervisord answers. Raises DeploymentError when a system runs already.

        :param check: is called while another start or stop is awaited
        """
        with self._alone(check):
            if pid := self.supervisor():
                raise DeploymentError(f"Already running: supervisord has pid {pid} and works in {self.run}")
            self._environment = dict(os.environ)  # also for `start_again`
            self.logs.mkdir(exist_ok=True)
            shutil.rmtree(self.run / SETTINGS, ignore_errors=True)
            self.parameters.write_text(yaml.safe_dump(dict(parameters), sort_keys=False))
            self._start_supervisor()

    def start_again(self, check: Check = lambda: None) -> bool:
        """Start it as it was, after supervisord died; whether that was right: its end may have been meant."""
        with self._alone(check):
            if not self.is_wanted:
                return False
            if self.supervisor():
                self._supervisor = None  # somebody else has started it meanwhile
            else:
                self._start_supervisor()
            return True

    def supervisor_has_ended(self) -> bool:
        """Whether the supervisord has ended that was started here, or that ran when this was first asked."""
        if self._supervisor is None:
            pid = self.supervisor()
            if pid is None:
                return True
            self._supervisor = os.pidfd_open(pid)
        return not processes.await_end([self._supervisor], 0.0)

    def stop(self, check: Check = lambda: None, tell: Callable[[int], None] = lambda count: None) -> int:
        """End every process of the system, with supervisord's help or without.

        :param tell: is given their number before they are ended
        :return: their number
        """
        with self._alone(check):
            count = len(self.members())
            tell(count)
            self.parameters.unlink(missing_ok=True)  # from here on it is not wanted
            if pid := self.supervisor():
                handles = processes.open_handles(self.run, [p.pid for p in self.members()])
                try:
                    self._call(pid, "supervisor.shutdown", timeout=OBEY_LIMIT)
                    processes.await_end(handles, SUPERVISOR_GRACE)
                except (OSError, http.client.HTTPException, xmlrpc.client.Error):
                    pass  # hung or just dying: then without its help
                finally:
                    processes.close(handles)
            self._end_members()
        return count

    def programs(self) -> list[Program]:
        """All programs as supervisord sees them. Raises DeploymentError when it does not answer."""
        pid = self.supervisor()
        if pid is None:
            raise DeploymentError(self.unattended())
        try:
            rows = cast(list[dict[str, Any]], self._call(pid, "supervisor.getAllProcessInfo"))
            starts = cast(dict[str, int], self._call(pid, "arm.starts"))
        except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
            raise DeploymentError(f"supervisord (pid {pid}) does not answer: {error}") from error
        return [
            Program(
                name=row["name"],
                state=row["statename"],
                pid=row["pid"],
                uptime=row["now"] - row["start"] if row["pid"] else 0,
                restarts=max(starts.get(row["name"], 0) - 1, 0),
                description=row["spawnerr"] or row["description"],
            )
            for row in rows
        ]

    def watch(self, supervisor: int) -> list[Watched]:
        """What the sentinel has to know of each program; its asking is its sign of life."""
        rows = cast(list[dict[str, Any]], self._ask(supervisor, "arm.watch"))
        return [Watched(**row) for row in rows]

    def revive(self, supervisor: int, program: str) -> None:
        """Start a program that supervisord has given up. Raises DeploymentError."""
        self._ask(supervisor, "supervisor.startProcess", f"{GROUP}:{program}", False)

    def halt(self, program: str) -> None:
        """Stop a program until the system starts anew. Raises DeploymentError."""
        self._ask(self.supervisor() or 0, "supervisor.stopProcess", f"{GROUP}:{program}")

    def _ask(self, supervisor: int, method: str, *arguments: object) -> object:
        try:
            return self._call(supervisor, method, *arguments, timeout=ANSWER_LIMIT)
        except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
            raise DeploymentError(f"supervisord (pid {supervisor}) does not answer: {error}") from error

    def _end_members(self) -> None:
        """End what lives, without supervisord's help."""
        for _ in range(3):  # what is just being forked shows only in the next round
            left = self.members()
            if not left:
                return
            # supervisord first: it would start anew what ends.
            processes.end(self.run, [process.pid for process in left if not process.program], 0.0)
            processes.end(self.run, [process.pid for process in left if process.program], SERVICE_GRACE)
        raise DeploymentError(f"These processes do not end: {[process.pid for process in left]}")

    def _start_supervisor(self) -> None:
        self._end_members()
        environment = dict(self._environment)
        environment[processes.MARK] = str(self.run)
        environment[NAMESPACE] = namespace_of(environment)
        environment["PYTHONUNBUFFERED"] = "1"
        _prepend(environment, "PATH", str(Path(sys.executable).parent))
        _prepend(environment, "PYTHONPATH", str(processes.ROOT))
        output = self.logs / "supervisord.out"
        with output.open("wb") as file:
            process = subprocess.Popen(
                [*self._within, sys.executable, "-m", "supervisor.supervisord", "-c", str(CONFIGURATION)],
                cwd=self.run,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C at the terminal is for the launcher, which stops it in order
                umask=0o077,
            )
        deadline = time.monotonic() + READY_GRACE
        while process.poll() is None and time.monotonic() < deadline:
            try:
                self._call(process.pid, "supervisor.getState")
                self._supervisor = os.pidfd_open(process.pid)
                return
            except (OSError, http.client.HTTPException, xmlrpc.client.Error):
                time.sleep(0.02)
        process.kill()
        process.wait()
        self._end_members()  # what it may have started already
        raise DeploymentError(f"supervisord does not start:\n{output.read_text(errors='replace').strip()}")

    def _call(self, pid: int, method: str, *arguments: object, timeout: float = 5.0) -> object:
        """Call supervisord's XML-RPC through its directory: the socket's own path may be too long."""
        transport = _UnixTransport(f"/proc/{pid}/cwd/supervisor.sock", timeout)
        with xmlrpc.client.ServerProxy("http://localhost", transport=transport) as server:
            return cast(object, getattr(server, method)(*arguments))

    @contextmanager
    def _alone(self, check: Check) -> Iterator[None]:
        """Hold the run directory: only one start or stop at a time."""
        self.run.mkdir(mode=0o700, parents=True, exist_ok=True)
        directory = os.open(self.run, os.O_RDONLY)
        try:
            if not _locked(directory):
                with suppress(OSError):  # perhaps nobody reads it any more
                    say("Waiting for another make to end its start or stop.")
                while not _locked(directory):
                    check()
                    time.sleep(LOCK_INTERVAL)
            yield
        finally:
            os.close(directory)


class _UnixConnection(http.client.HTTPConnection):
    """HTTP over a unix socket."""

    def __init__(self, path: str, timeout: float) -> None:
        super().__init__("localhost")
        self._path = path
        self._limit = timeout

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self._limit)
        self.sock.connect(self._path)


class _UnixTransport(xmlrpc.client.Transport):
    """XML-RPC over a unix socket, with a time limit for a hung supervisord."""

    def __init__(self, path: str, timeout: float) -> None:
        super().__init__()
        self._unix_connection = _UnixConnection(path, timeout)

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        return self._unix_connection

    def close(self) -> None:
        self._unix_connection.close()


def _locked(descriptor: int) -> bool:
    """Lock a file or directory unless somebody else has; whether that has worked."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def namespace_of(environment: Mapping[str, str]) -> str:
    """The ROS namespace that the arm of an environment lives in."""
    return environment.get(NAMESPACE) or "/"


def _prepend(environment: dict[str, str], name: str, path: str) -> None:
    rest = environment.get(name)
    environment[name] = f"{path}{os.pathsep}{rest}" if rest else path
