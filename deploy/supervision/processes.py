"""The processes of a system, from the kernel's process table: files may be stale.

Every process of a system, from supervisord down, carries the mark of its run directory in its environment,
also after supervisord has died. A process without the mark is never touched, and the mark of another user's
process counts for nothing: he chooses its environment. Signals go through pidfds: they never reach another
process that has the pid meanwhile. Standard library only: `make setup` and `make stop` work without .venv.
"""

from __future__ import annotations

import os
import select
import signal
import struct
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from interfaces import arm_variables
from interfaces.seam import replaceable

MARK = arm_variables.SYSTEM
RUN_DIRECTORY = "REACTIVE_ARM_RUN_DIR"  # environment variable
_TICKS = os.sysconf("SC_CLK_TCK")
ROOT = Path(__file__).resolve().parents[2]
_AT_SECURE = 23  # getauxval(3): whether a program began with more rights than its caller
_AUXILIARY = struct.Struct("@LL")  # a key and its value


class Process(NamedTuple):
    pid: int
    program: str
    """the supervised program; '' for supervisord itself"""


class Effort(NamedTuple):
    """The times that the kernel has given a process since its start [s]."""

    loop: float
    """processor time of its main thread, on which a service runs its loop"""
    waited: float
    """time for which its main thread waited for a processor"""
    others: float
    """processor time of its other threads"""


def run_directory() -> Path:
    """The directory of a system's runtime files: REACTIVE_ARM_RUN_DIR, or .run in this checkout."""
    return given_run_directory().resolve()


def given_run_directory() -> Path:
    """The same; the path may have symbolic links."""
    return Path(os.environ.get(RUN_DIRECTORY) or ROOT / ".run").absolute()


def environment_of(pid: int) -> dict[str, str]:
    """The environment that a process was started with; empty for a process that has ended or is not ours."""
    environ = b""
    with suppress(OSError), _opened(pid) as directory:
        if _is_ours(directory):
            environ = _content("environ", directory)
            if not _is_ours(directory):  # it has become the process of another user meanwhile
                environ = b""
    pairs = (os.fsdecode(entry).partition("=") for entry in environ.split(b"\0") if entry)
    return {key: value for key, _, value in pairs}


@contextmanager
def _opened(pid: int) -> Iterator[int]:
    """Open the directory of a process: it never shows another process that has the pid meanwhile."""
    directory = os.open(f"/proc/{pid}", os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield directory
    finally:
        os.close(directory)


def _is_ours(directory: int) -> bool:
    """Whether this user has chosen the environment of a process: not if it only has his rights.

    Another user may start a set-user-ID program, and the root of a container has his own processes.
    """
    status = _content("status", directory)
    users = next(line.split()[1:] for line in status.splitlines() if line.startswith(b"Uid:"))
    vector = _content("auxv", directory)
    values = dict(_AUXILIARY.iter_unpack(vector[: len(vector) // _AUXILIARY.size * _AUXILIARY.size]))
    is_here = os.readlink("ns/pid", dir_fd=directory) == os.readlink("/proc/self/ns/pid")
    return {*map(int, users)} == {os.geteuid()} and values.get(_AT_SECURE) == 0 and is_here


def _content(name: str, directory: int) -> bytes:
    with open(os.open(name, os.O_RDONLY, dir_fd=directory), "rb") as file:
        return file.read()


@replaceable
def stat_of(pid: int) -> list[str]:
    """State, parent and the further fields of /proc/PID/stat (proc(5)); empty when the process has ended."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return file.read().decode(errors="replace").rpartition(") ")[2].split()
    except OSError:
        return []


@replaceable
def effort_of(pid: int, stat: Sequence[str]) -> Effort | None:
    """The times that a process got; ``None`` when it has ended, or if the kernel does not count it.

    :param stat: the fields of :func:`stat_of`.
    """
    if not stat:
        return None
    try:
        with open(f"/proc/{pid}/schedstat", "rb") as file:
            loop, waited = (int(field) / 1e9 for field in file.read().split()[:2])
    except (OSError, ValueError):
        return None
    total = (int(stat[11]) + int(stat[12])) / _TICKS
    return Effort(loop, waited, max(0.0, total - loop))


@replaceable
def of_system(run: Path) -> list[Process]:
    """The live processes of the system with this run directory, supervisord first."""
    found = [
        Process(pid, environment.get("SUPERVISOR_PROCESS_NAME", ""))
        for pid, environment in _marked(str(run))
        if environment[MARK] == str(run)
    ]
    return sorted(found, key=lambda process: (process.program, process.pid))


def systems() -> dict[Path, dict[str, str]]:
    """The environments of the running systems of this user, by run directory."""
    return {Path(environment[MARK]): environment for _, environment in _marked()}


def using(directory: Path) -> list[Path]:
    """The run directories of the systems that run the programs of a directory."""
    first = f"{directory}{os.pathsep}"
    # Any process will do: without the directory, a service that starts again finds an interpreter elsewhere.
    return sorted({Path(each[MARK]) for _, each in _marked() if each.get("PATH", "").startswith(first)})


def all_pids() -> Iterator[int]:
    """The processes of this machine, of all users."""
    return (int(name) for name in os.listdir("/proc") if name.isdigit())


def running(directory: Path) -> Iterator[tuple[int, str]]:
    """This user's processes of programs in a directory, with their command lines."""
    for pid in all_pids():
        with suppress(OSError), open(f"/proc/{pid}/cmdline", "rb") as file:
            words = os.fsdecode(file.read()).split("\0")
            program = os.path.normpath(os.path.join(os.readlink(f"/proc/{pid}/cwd"), words[0]))
            is_ours = os.fstat(file.fileno()).st_uid == os.geteuid()
            if is_ours and os.path.dirname(program) == str(directory):
                yield pid, " ".join(" ".join(words).split())


def _marked(begin: str = "") -> Iterator[tuple[int, dict[str, str]]]:
    """Marked processes with their environments: all whose mark begins with this text, and perhaps others."""
    mark = os.fsencode(f"{MARK}={begin}")
    for pid in all_pids():
        # A machine has many processes: only these few have their owner checked, and are parsed.
        if mark in _environ(pid) and MARK in (environment := environment_of(pid)):
            yield pid, environment


def _environ(pid: int) -> bytes:
    try:
        with open(f"/proc/{pid}/environ", "rb") as file:
            return file.read()
    except OSError:
        return b""


def end(run: Path, pids: Iterable[int], grace: float) -> None:
    """End processes of a system: SIGTERM, and SIGKILL for those that live after `grace` seconds."""
    handles = open_handles(run, pids)
    try:
        for number, wait in ((signal.SIGTERM, grace), (signal.SIGKILL, 5.0)):
            for handle in handles:
                with suppress(ProcessLookupError):
                    signal.pidfd_send_signal(handle, number)
            handles_left = await_end(handles, wait)
            close([handle for handle in handles if handle not in handles_left])
            handles = handles_left
    finally:
        close(handles)


def open_handles(run: Path, pids: Iterable[int]) -> list[int]:
    """Open pidfds of the processes that live and belong to the system; `close` them."""
    handles = []
    for pid in pids:
        with suppress(ProcessLookupError):
            handle = os.pidfd_open(pid)
            # From here on the pid surely belongs to the process that the pidfd holds.
            if environment_of(pid).get(MARK) == str(run):
                handles.append(handle)
            else:
                os.close(handle)
    return handles


@replaceable
def send_signal(run: Path, program: str, pid: int, number: int) -> bool:
    """Send a signal to a process that a program of the system has; whether it still has that process."""
    for handle in open_handles(run, [pid] if pid > 0 else []):
        try:
            # Through the handle the signal reaches this very process, or none.
            if environment_of(pid).get("SUPERVISOR_PROCESS_NAME") == program:
                signal.pidfd_send_signal(handle, number)
                return True
        except ProcessLookupError:
            pass
        finally:
            close([handle])
    return False


def await_end(handles: Iterable[int], wait: float) -> list[int]:
    """Wait at most `wait` seconds for the end of processes; the pidfds of those that live on."""
    left = list(handles)
    poll = select.poll()
    for handle in left:
        poll.register(handle, select.POLLIN)
    deadline = time.monotonic() + wait
    while left and (ended := poll.poll(max(0.0, deadline - time.monotonic()) * 1000)):
        for handle, _ in ended:
            poll.unregister(handle)
            left.remove(handle)
    return left


def close(handles: Iterable[int]) -> None:
    for handle in handles:
        os.close(handle)
