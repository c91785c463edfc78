"""The running system of a checkout: supervisord, its programs and their runtime files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from deploy.supervision import environment, manifest, messages, processes, supervisord
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import MANIFEST, RunDirectory
from deploy.supervision.supervisord import Program, Supervisord

SERVICE_GRACE = 1.0  # s from SIGTERM to SIGKILL of a service, as in supervisord.conf
SUPERVISOR_GRACE = 1.4  # s that supervisord has to stop all of them


class System(RunDirectory):
    """The system whose runtime files lie in one run directory, whether it runs or not."""

    def __init__(self, run: Path | None = None, within: Sequence[str] = ()) -> None:
        """:param within: a command in front of supervisord's own, such as `ip netns exec NAME`"""
        super().__init__(run)
        self._within = within
        self._supervisor: int | None = None  # a pidfd
        self._environment = dict(os.environ)

    def members(self) -> list[processes.Process]:
        """The live processes of the system, and those that a dead supervisord left behind."""
        return processes.of_system(self.run)

    def supervisor(self) -> int | None:
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
        with self.alone():
            self._prepare(parameters)
            self._environment = dict(os.environ)  # also for `start_again`
            try:
                self._start_supervisor()
            except BaseException:
                self.remove_settings()  # they are in memory, and nothing that runs knows them
                raise

    def start_again(self) -> bool:
        """Start the system as it was after supervisord died; False if it was stopped on purpose."""
        with self.alone():
            if not self.is_wanted:
                return False
            if self.supervisor():
                self._supervisor = None  # another terminal has started it meanwhile
            else:
                self._start_supervisor()
            return True

    def become_supervisord(self, parameters: Mapping[str, object], arguments: Sequence[str]) -> NoReturn:
        """Start as `start` does, but replace this process by supervisord with these arguments."""
        with self.alone():
            self._prepare(parameters)
            self._end_members()
            self.part_logs()
            os.chdir(self.run)
            os.umask(0o077)
            command = [*supervisord.COMMAND, *arguments]
            os.execve(command[0], command, environment.of_supervisord(os.environ, self.run))

    def supervisor_has_ended(self) -> bool:
        """Whether the supervisord has ended that was started here, or that ran at the first call."""
        if self._supervisor is None:
            pid = self.supervisor()
            if pid is None:
                return True
            self._supervisor = os.pidfd_open(pid)
        return not processes.await_end([self._supervisor], 0.0)

    def stop(self, report: Callable[[int], None] = lambda count: None) -> int:
        """End every process of the system; return their number, which ``report`` is called with before."""
        if not self.logs.exists() and not self.members():
            report(0)
            self.remove_settings()
            return 0
        with self.alone():
            count = len(self.members())
            report(count)
            with suppress(OSError):  # a read-only checkout
                self.parameters.unlink()  # a terminal that guards the system does not start it again
            if pid := self.supervisor():
                handles = processes.open_handles(self.run, [p.pid for p in self.members()])
                with suppress(DeploymentError):  # it hangs or dies just now
                    Supervisord(pid).shut_down()
                    processes.await_end(handles, SUPERVISOR_GRACE)
                processes.close(handles)
            self._end_members()
            self.remove_settings()
        return count

    def programs(self) -> list[Program]:
        """All programs as supervisord sees them. Raises DeploymentError when it does not answer."""
        return self._supervisord().programs()

    def halt(self, program: str) -> None:
        """Stop a program until the next start of the system. Raises DeploymentError."""
        self._supervisord().halt(program)

    def _supervisord(self) -> Supervisord:
        if pid := self.supervisor():
            return Supervisord(pid)
        raise DeploymentError(messages.unattended(self.run))

    # The steps of start and stop

    def _prepare(self, parameters: Mapping[str, object]) -> None:
        if pid := self.supervisor():
            where = f"supervisord has pid {pid} and works in {self.run}"
            raise DeploymentError(f"Already running: {where}. make terminal shows it, make stop ends it")
        self.write_parameters(parameters)
        self.forget_settings([program.name for program in manifest.programs()])
        if manifest.path() != manifest.PATH:
            os.environ[manifest.VARIABLE] = shutil.move(manifest.path(), str(self.run / MANIFEST))

    def _end_members(self) -> None:
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
        self.part_logs()
        try:
            inherited = environment.of_supervisord(self._environment, self.run)
            self._supervisor = os.pidfd_open(supervisord.start(self.run, inherited, self._within))
        except BaseException:
            self._end_members()  # the services that it has started already
            raise
