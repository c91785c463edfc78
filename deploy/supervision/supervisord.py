"""supervisord: start it, stop it, and ask it about its programs."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from deploy.supervision import interruption, manifest, messages, rpc
from deploy.supervision.errors import DeploymentError
from interfaces.seam import replaceable

COMMAND = (sys.executable, "-m", "supervisor.supervisord")
ANSWER_LIMIT = 1.5  # s that it has to answer the sentinel
OBEY_LIMIT = 0.4  # s that it has to accept a shutdown; all of it ends within 2 s
READY_LIMIT = 20.0  # s that it has to answer its first call


class Program(NamedTuple):
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
    away: float = 0.0
    """[s] from the last end of a process to the next start; 0 before the first"""
    host: str = ""
    """the name of its host, as a sentinel reports it; '' for this host"""


def start(run: Path, environment: Mapping[str, str], within: Sequence[str] = ()) -> int:
    """Start it in a run directory, and return its pid as soon as it answers. Raises DeploymentError.

    :param within: a command in front of its own, such as `ip netns exec NAME`.
    """
    output = run / "logs" / "supervisord.out"
    with output.open("wb") as file:
        process = subprocess.Popen(
            [*within, *COMMAND, "--nodaemon", "--silent", "-c", str(manifest.path())],
            cwd=run,
            env=environment,
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
                return process.pid
            time.sleep(0.02)
        is_slow = process.poll() is None
        silence = f"It has not answered for {READY_LIMIT:g} s" if is_slow else messages.silent_end(run)
        reason = output.read_text(errors="replace").strip() or silence
        raise DeploymentError(f"supervisord does not start:\n{reason}")
    except BaseException:
        process.kill()
        process.wait()
        raise


class Supervisord:
    """A running supervisord. Its methods raise DeploymentError when it does not answer."""

    def __init__(self, pid: int) -> None:
        self.pid = pid

    def programs(self) -> list[Program]:
        return self._programs("arm.programs", rpc.LIMIT)

    @replaceable
    def watch(self) -> list[Program]:
        """The programs for the sentinel; this call is the sentinel's sign of life."""
        return self._programs("arm.watch", ANSWER_LIMIT)

    @replaceable
    def revive(self, program: str) -> None:
        """Start a program that it has given up."""
        self._ask("supervisor.startProcess", _full_name(program), False, timeout=ANSWER_LIMIT)

    def halt(self, program: str) -> None:
        """Stop a program until the next start of the system."""
        self._ask("supervisor.stopProcess", _full_name(program))

    def shut_down(self) -> None:
        """Begin to stop all programs, and then itself."""
        self._ask("supervisor.shutdown", timeout=OBEY_LIMIT)

    def _programs(self, method: str, timeout: float) -> list[Program]:
        answer = self._ask(method, timeout=timeout)
        try:
            return [Program(**row) for row in json.loads(answer)]
        except (TypeError, ValueError) as error:  # the user has updated the checkout of a running system
            raise DeploymentError(
                f"supervisord (pid {self.pid}) runs another version of this program: make stop, make start"
            ) from error

    def _ask(self, method: str, *arguments: object, timeout: float = rpc.LIMIT) -> Any:
        try:
            return rpc.call(self.pid, method, *arguments, timeout=timeout)
        except rpc.NoAnswer as error:
            raise DeploymentError(str(error)) from error


def _full_name(program: str) -> str:
    return f"{manifest.GROUP}:{program}"
