"""The processes of a system, from the kernel's process table: files may be stale.

Every process of a system, from supervisord down, carries the mark of its run directory in its environment,
also after supervisord has died. A process without the mark is never touched. Signals go through pidfds: they
never reach another process that has the pid meanwhile. Standard library only: `make setup` and `make stop`
work without .venv.
"""

from __future__ import annotations

import os
import select
import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

MARK = "REACTIVE_ARM_SYSTEM"
RUN_DIRECTORY = "REACTIVE_ARM_RUN_DIR"  # environment variable
ROOT = Path(__file__).resolve().parents[2]


class Process(NamedTuple):
    pid: int
    program: str
    """the supervised program; '' for supervisord itself"""


def run_directory() -> Path:
    """The directory of a system's runtime files: REACTIVE_ARM_RUN_DIR, or .run in this checkout."""
    return Path(os.environ.get(RUN_DIRECTORY) or ROOT / ".run").resolve()


def environment_of(pid: int) -> dict[str, str]:
    """The environment that a process was started with; empty for a process that has ended or is not ours."""
    return _variables(_environ(pid))


def _variables(environ: bytes) -> dict[str, str]:
    pairs = (os.fsdecode(entry).partition("=") for entry in environ.split(b"\0") if entry)
    return {key: value for key, _, value in pairs}


def _environ(pid: int) -> bytes:
    try:
        with open(f"/proc/{pid}/environ", "rb") as file:
            return file.read()
    except OSError:
        return b""


def stat_of(pid: int) -> list[str]:
    """State, parent and the further fields of /proc/PID/stat (proc(5)); empty when the process has ended."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return file.read().decode(errors="replace").rpartition(") ")[2].split()
    except OSError:
        return []


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


def _marked(begin: str = "") -> Iterator[tuple[int, dict[str, str]]]:
    """Marked processes with their environments: all whose mark begins so, and perhaps others."""
    mark = os.fsencode(f"{MARK}={begin}")
    for pid in (int(name) for name in os.listdir("/proc") if name.isdigit()):
        environ = _environ(pid)
        if mark in environ:  # a machine has many processes: only these few environments are parsed
            environment = _variables(environ)
            if MARK in environment:
                yield pid, environment


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
