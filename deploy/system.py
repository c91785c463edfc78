"""The running system of a checkout: supervisord, its programs and their runtime files under .run/."""

from __future__ import annotations

import fcntl
import http.client
import os
import socket
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, cast

import yaml

from deploy import processes

CONFIGURATION = processes.ROOT / "deploy" / "supervisord.conf"
SERVICE_GRACE = 1.0  # s from SIGTERM to SIGKILL of a service, as in supervisord.conf
SUPERVISOR_GRACE = 2.5  # s that supervisord has to stop all of them
READY_GRACE = 20.0  # s that supervisord has to answer its first call


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


class System:
    """The system whose runtime files lie in one run directory, whether it runs or not."""

    def __init__(self, run: Path | None = None) -> None:
        self.run = run or processes.run_directory()

    @property
    def logs(self) -> Path:
        """Where each program and supervisord write their logs."""
        return self.run / "logs"

    @property
    def parameters(self) -> Path:
        """The ROS parameter file of all services, written at each start."""
        return self.run / "parameters.yaml"

    def supervisor(self) -> int | None:
        """The pid of the running supervisord."""
        return next((process.pid for process in processes.of_system(self.run) if not process.program), None)

    def services(self) -> dict[str, list[int]]:
        """The pids of the live services by program, also of those that a dead supervisord left behind."""
        found: dict[str, list[int]] = {}
        for process in processes.of_system(self.run):
            if process.program:
                found.setdefault(process.program, []).append(process.pid)
        return found

    def environment(self) -> dict[str, str]:
        """The environment that the running system was started with; empty when none runs."""
        pid = self.supervisor()
        return processes.environment_of(pid) if pid else {}

    def start(self, parameters: Mapping[str, object]) -> subprocess.Popen[bytes]:
        """Start supervisord with its programs, all with these parameters (content of a ROS parameter file).

        What a killed supervisord left behind is ended first: no service ever lives twice. Returns the process
        of supervisord as soon as it answers. Raises DeploymentError when a system runs already.
        """
        with self._alone():
            if pid := self.supervisor():
                raise DeploymentError(f"Already running: supervisord has pid {pid} and works in {self.run}")
            processes.end(self.run, [process.pid for process in processes.of_system(self.run)], SERVICE_GRACE)
            self.logs.mkdir(parents=True, exist_ok=True)
            self.run.chmod(0o700)
            self.parameters.write_text(yaml.safe_dump(dict(parameters), sort_keys=False))
            return self._start_supervisor()

    def stop(self) -> None:
        """End every process of the system, with supervisord's help or without."""
        with self._alone():
            if pid := self.supervisor():
                handles = processes.open_handles(self.run, [p.pid for p in processes.of_system(self.run)])
                try:
                    self._call(pid, "supervisor.shutdown", timeout=SUPERVISOR_GRACE)
                    processes.await_end(handles, SUPERVISOR_GRACE)
                except (OSError, http.client.HTTPException, xmlrpc.client.Error):
                    pass  # hung or just dying: then without its help
                finally:
                    processes.close(handles)
            for _ in range(3):
                left = processes.of_system(self.run)
                # supervisord first, as it would start anew what ends.
                processes.end(self.run, [process.pid for process in left if not process.program], 0.0)
                processes.end(self.run, [process.pid for process in left if process.program], SERVICE_GRACE)
                if not left:
                    return
        raise DeploymentError(f"These processes do not end: {[process.pid for process in left]}")

    def programs(self) -> list[Program]:
        """All programs as supervisord sees them. Raises DeploymentError when it does not answer."""
        pid = self.supervisor()
        if pid is None:
            raise DeploymentError(f"Nothing is supervised in {self.run}")
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
            )
            for row in rows
        ]

    def restart_program(self, name: str) -> None:
        """Stop one program and start it again."""
        pid = self.supervisor()
        if pid is None:
            raise DeploymentError(f"Nothing is supervised in {self.run}")
        self._call(pid, "supervisor.stopProcess", f"arm:{name}")
        self._call(pid, "supervisor.startProcess", f"arm:{name}", False)

    def _start_supervisor(self) -> subprocess.Popen[bytes]:
        environment = dict(os.environ)
        environment[processes.MARK] = str(self.run)
        environment["PYTHONUNBUFFERED"] = "1"
        _prepend(environment, "PATH", str(Path(sys.executable).parent))
        _prepend(environment, "PYTHONPATH", str(processes.ROOT))
        output = self.logs / "supervisord.out"
        with output.open("wb") as file:
            process = subprocess.Popen(
                [sys.executable, "-m", "supervisor.supervisord", "-c", str(CONFIGURATION)],
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
                return process
            except (OSError, http.client.HTTPException, xmlrpc.client.Error):
                time.sleep(0.02)
        process.kill()
        process.wait()
        raise DeploymentError(f"supervisord does not start:\n{output.read_text(errors='replace').strip()}")

    def _call(self, pid: int, method: str, *arguments: object, timeout: float = 5.0) -> object:
        """Call supervisord's XML-RPC through its directory: the socket's own path may be too long."""
        transport = _UnixTransport(f"/proc/{pid}/cwd/supervisor.sock", timeout)
        with xmlrpc.client.ServerProxy("http://localhost", transport=transport) as server:
            return cast(object, getattr(server, method)(*arguments))

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold the run directory: only one start or stop at a time."""
        self.run.mkdir(mode=0o700, parents=True, exist_ok=True)
        directory = os.open(self.run, os.O_RDONLY)
        try:
            fcntl.flock(directory, fcntl.LOCK_EX)
            yield
        finally:
            os.close(directory)


class _UnixTransport(xmlrpc.client.Transport):
    """XML-RPC over a unix socket, with a time limit for a hung supervisord."""

    def __init__(self, path: str, timeout: float) -> None:
        super().__init__()
        self._path = path
        self._timeout = timeout

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = http.client.HTTPConnection("localhost", timeout=self._timeout)
        connection.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.sock.settimeout(self._timeout)
        connection.sock.connect(self._path)
        return connection


def _prepend(environment: dict[str, str], name: str, path: str) -> None:
    rest = environment.get(name)
    environment[name] = f"{path}{os.pathsep}{rest}" if rest else path
