"""Which processes belong to a system: asked of the kernel's process table, not of files that may be stale.

Every process of a system, from supervisord down, carries the mark of its run directory in its environment,
and keeps it when supervisord dies. A process without the mark is never touched; one that has it is addressed
through a pidfd, so that a pid that was given to somebody else meanwhile cannot be hit. Standard library only:
the set-up uses it before anything is installed.
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
ROOT = Path(__file__).resolve().parents[2]


class Process(NamedTuple):
    """One live process of a system."""

    pid: int
    program: str
    """the supervised program; '' for supervisord itself"""


def run_directory() -> Path:
    """Where a system of this checkout keeps its runtime files: .run, or what REACTIVE_ARM_RUN_DIR says."""
    return Path(os.environ.get("REACTIVE_ARM_RUN_DIR") or ROOT / ".run").resolve()


def environment_of(pid: int) -> dict[str, str]:
    """The environment that a process was started with; empty when it has ended or is somebody else's."""
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
    """State, parent and what else proc(5) has in `stat` after a process' name; empty when it has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    except OSError:
        return []


def of_system(run: Path) -> list[Process]:
    """The live processes of the system with this run directory, supervisord first."""
    found = [
        Process(pid, environment.get("SUPERVISOR_PROCESS_NAME", ""))
        for pid, environment in _marked(str(run))
        if environment.get(MARK) == str(run)
    ]
    return sorted(found, key=lambda process: (process.program, process.pid))


def using(directory: Path) -> list[Path]:
    """The run directories of the systems whose programs are taken from a directory first of all."""
    first = f"{directory}{os.pathsep}"
    return sorted(
        {
            Path(environment[MARK])
            for _, environment in _marked()
            if MARK in environment and environment.get("PATH", "").startswith(first)
        }
    )


def _marked(begin: str = "") -> Iterator[tuple[int, dict[str, str]]]:
    """Processes, with their environments, that may have a mark which begins so."""
    mark = os.fsencode(f"{MARK}={begin}")
    for pid in (int(name) for name in os.listdir("/proc") if name.isdigit()):
        environ = _environ(pid)
        if mark in environ:  # without a look at each variable of the others: a machine has many processes
            yield pid, _variables(environ)


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
    """Pidfds of those of these processes that live and belong to the system; to be given to `close`."""
    handles = []
    for pid in pids:
        with suppress(ProcessLookupError):
            handle = os.pidfd_open(pid)
            # Asked once more: only now does the pid surely stand for the process that the pidfd holds.
            if environment_of(pid).get(MARK) == str(run):
                handles.append(handle)
            else:
                os.close(handle)
    return handles


def await_end(handles: Iterable[int], wait: float) -> list[int]:
    """Wait at most `wait` seconds until the processes behind these pidfds have ended; those that have not."""
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
    """Give pidfds back."""
    for handle in handles:
        os.close(handle)
