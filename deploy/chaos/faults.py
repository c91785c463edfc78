"""The faults: what the monkey can do to an arm. Each says whom it may be done to and does it.

A fault returns what ends it, or None if it takes no time.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Protocol

import yaml

from deploy.chaos.history import ALL, NOTHING, PROGRAMS
from deploy.chaos.marks import BABBLER
from deploy.supervision import processes
from deploy.supervision.system import System

INJECTED = Path(__file__).parent / "inject"
"""Has to stand on the PYTHONPATH of the system, for `hang`, `raise` and `hog`."""
HEADROOM = 64 << 20  # bytes that a hog may take

PARAMETERS = {
    "config_l1": "value",
    "config_l2": "value",
    "config_theta1": "value",
    "config_theta2": "value",
    "dead_mans_switch": "rate",
    "operator_watchdog": "strikes",
    "engine_controller": "presence_timeout",
    "sentinel": "look",
}
"""A parameter of each program that has one; each is a number."""

Undo = Callable[[], None]


class Arm(Protocol):
    """What a fault needs to know of its victim."""

    namespace: str
    system: System

    def pid(self, program: str) -> int:
        """The process of a program; 0 if there is none just now."""

    def environment(self) -> dict[str, str]:
        """The environment of the arm's processes."""


class Fault(NamedTuple):
    """A kind of fault."""

    do: Callable[[Arm, str], Undo | None]
    targets: tuple[str, ...]
    lasting: tuple[float, float] = (0.0, 0.0)
    """how long it may last [s]: at least, at most"""


def _signals(number: int) -> Callable[[Arm, str], Undo | None]:
    def send(arm: Arm, program: str) -> None:
        _send(arm, arm.pid(program), number)

    return send


def _send(arm: Arm, pid: int, number: int) -> None:
    for handle in processes.open_handles(arm.system.run, [pid] if pid else []):
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, number)
        processes.close([handle])


def stop(arm: Arm, program: str) -> Undo:
    """SIGSTOP, and SIGCONT in the end, if it still lives then."""
    pid = arm.pid(program)
    _send(arm, pid, signal.SIGSTOP)
    return lambda: _send(arm, pid, signal.SIGCONT)


def hog(arm: Arm, program: str) -> None:
    """Let it take memory up to a limit near by."""
    pid = arm.pid(program)
    with suppress(OSError):
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[0])
        limit = pages * os.sysconf("SC_PAGE_SIZE") + HEADROOM
        resource.prlimit(pid, resource.RLIMIT_AS, (limit, limit))
        _send(arm, pid, signal.SIGRTMIN)


def kill_all(arm: Arm, target: str) -> None:
    """SIGKILL all programs at once."""
    pids = [process.pid for process in arm.system.members() if process.program not in ("", BABBLER)]
    handles = processes.open_handles(arm.system.run, pids)
    for handle in handles:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, signal.SIGKILL)
    processes.close(handles)


def kill_supervisor(arm: Arm, target: str) -> Undo:
    """SIGKILL supervisord; in the end the system is started again over what it left behind."""
    _send(arm, arm.system.supervisor() or 0, signal.SIGKILL)

    def start_again() -> None:
        arm.system.start_again()

    return start_again


def double(arm: Arm, program: str) -> Undo:
    """Start a second instance of a service, as somebody who does not know that it runs."""
    command = []
    with suppress(OSError):  # it has just ended
        command = Path(f"/proc/{arm.pid(program)}/cmdline").read_bytes().decode().split("\0")[1:-1]
    if not command:
        return lambda: None
    process = subprocess.Popen(
        [sys.executable, *command],
        cwd=arm.system.run,
        env=arm.environment() | {"SUPERVISOR_PROCESS_NAME": program},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return _ender(process)


def crash_loop(arm: Arm, program: str) -> Undo:
    """A parameter of the wrong type, which the program refuses from its next start on."""
    parameters = arm.system.parameters
    node = f"{arm.namespace.rstrip('/')}/{program}"
    bad = {node: {"ros__parameters": {PARAMETERS[program]: "a few"}}}
    parameters.write_text(yaml.safe_dump(yaml.safe_load(parameters.read_text()) | bad))
    _send(arm, arm.pid(program), signal.SIGKILL)

    def repair() -> None:
        with suppress(FileNotFoundError):  # the system was stopped
            # Another program may have a bad parameter now.
            left = yaml.safe_load(parameters.read_text())
            left.pop(node, None)
            parameters.write_text(yaml.safe_dump(left))

    return repair


def full_disk(arm: Arm, target: str) -> Undo:
    """No log can be written any more."""
    supervisor = arm.system.supervisor()
    if supervisor is None:
        return lambda: None

    def limit(size: int | None) -> None:
        with suppress(OSError):
            _, hard = resource.prlimit(supervisor, resource.RLIMIT_FSIZE)
            resource.prlimit(supervisor, resource.RLIMIT_FSIZE, (hard if size is None else size, hard))

    limit(1)
    return lambda: limit(None)


def _babbler(*arguments: str) -> Callable[[Arm, str], Undo]:
    def babble(arm: Arm, target: str) -> Undo:
        process = subprocess.Popen(
            [sys.executable, "-m", "deploy.chaos.babbler", *arguments],
            cwd=processes.ROOT,
            env=arm.environment() | {"ARM_NAMESPACE": arm.namespace, "SUPERVISOR_PROCESS_NAME": BABBLER},
            stdout=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the monkey
        )
        return _ender(process)

    return babble


def _ender(process: subprocess.Popen[bytes]) -> Undo:
    def end() -> None:
        process.kill()
        process.wait()

    return end


FAULTS: dict[str, Fault] = {
    "kill": Fault(_signals(signal.SIGKILL), PROGRAMS),
    "terminate": Fault(_signals(signal.SIGTERM), PROGRAMS),
    "stop": Fault(stop, PROGRAMS, (1.0, 15.0)),
    "hang": Fault(_signals(signal.SIGUSR1), PROGRAMS, (15.0, 15.0)),
    "raise": Fault(_signals(signal.SIGUSR2), PROGRAMS),
    "hog": Fault(hog, PROGRAMS),
    "kill_all": Fault(kill_all, (ALL,)),
    "kill_supervisor": Fault(kill_supervisor, (ALL,), (0.5, 5.0)),
    "double": Fault(double, PROGRAMS, (6.0, 8.0)),
    "crash_loop": Fault(crash_loop, tuple(PARAMETERS), (3.0, 6.0)),
    "full_disk": Fault(full_disk, (NOTHING,), (3.0, 10.0)),
    "flood": Fault(_babbler("flood"), (NOTHING,), (3.0, 6.0)),
    "babble": Fault(_babbler("babble"), (NOTHING,), (3.0, 10.0)),
}
"""All faults of one host; for those between hosts see `partition`."""
