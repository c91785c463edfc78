"""The kinds of faults that can be injected into an arm, and the targets of each."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import ros_yaml

from deploy.supervision import parameter_file, processes
from deploy.supervision.run_directory import KEY, with_parameters
from tests.chaos.arm import RealArm
from tests.promises import marks
from tests.promises.history import ALL, NO_TARGET, programs_of_manifest
from tests.promises.marks import BABBLER

INJECTED = Path(__file__).parent / "inject"
"""On the PYTHONPATH of an arm under test; the faults `hang`, `raise` and `hog` need it."""
HEADROOM = 64 << 20  # bytes that a process may still allocate in `hog`


def _numbers() -> dict[str, str]:
    """Return the first parameter that is a number, of each program that has one."""
    return {
        program: name
        for program, declared in parameter_file.declared().items()
        for name in [name for name, each in declared.items() if type(each.default) in (int, float)][:1]
    }


PARAMETERS = _numbers()

Undo = Callable[[], None]


class FaultKind(NamedTuple):
    inject: Callable[[RealArm, str], Undo | None]
    """Injects the fault into an arm and a target; returns how to end it, or ``None`` if it is momentary."""
    targets: tuple[str, ...]
    duration: tuple[float, float] = (0.0, 0.0)
    """The shortest and the longest duration [s]."""


def _send(arm: RealArm, pid: int, number: int) -> None:
    for handle in processes.open_handles(arm.system.run, [pid] if pid else []):
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, number)
        processes.close([handle])


def _signal(number: int) -> Callable[[RealArm, str], None]:
    return lambda arm, program: _send(arm, arm.pid(program), number)


def stop(arm: RealArm, program: str) -> Undo:
    """Suspend a process by SIGSTOP; at the end, continue it if it is still alive."""
    pid = arm.pid(program)
    _send(arm, pid, signal.SIGSTOP)
    return arm.nested.begin(("stop", pid), lambda: _send(arm, pid, signal.SIGCONT))


def hog(arm: RealArm, program: str) -> None:
    """Let a process allocate memory up to a limit."""
    pid = arm.pid(program)
    with suppress(OSError):
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[0])
        limit = pages * os.sysconf("SC_PAGE_SIZE") + HEADROOM
        resource.prlimit(pid, resource.RLIMIT_AS, (limit, limit))
        _send(arm, pid, signal.SIGRTMIN)


def kill_all(arm: RealArm, target: str) -> None:
    pids = [process.pid for process in arm.system.members() if process.program not in ("", BABBLER)]
    handles = processes.open_handles(arm.system.run, pids)
    for handle in handles:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, signal.SIGKILL)
    processes.close(handles)


def kill_supervisor(arm: RealArm, target: str) -> Undo:
    """SIGKILL supervisord; at the end, start the system again over its orphans."""
    supervisor = arm.system.supervisor() or 0
    arm.remember_processor_time([supervisor])
    _send(arm, supervisor, signal.SIGKILL)

    def start_again() -> None:
        orphans = [member.pid for member in arm.system.members() if member.program not in ("", BABBLER)]
        arm.remember_processor_time(orphans)
        arm.system.start_again()

    return arm.nested.begin("kill_supervisor", start_again)


def double(arm: RealArm, program: str) -> Undo:
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
    return _kill(process)


def crash_loop(arm: RealArm, program: str) -> Undo:
    """SIGKILL a program after giving a parameter the wrong type: the program refuses to start."""
    path = arm.system.parameters
    node = f"{arm.namespace.rstrip('/')}/{program}"
    given = {node: arm.parameters[node]} if node in arm.parameters else {}
    bad = {node: {KEY: {PARAMETERS[program]: "not a number"}}}
    arm.system.write_parameters(with_parameters(ros_yaml.read(path), bad))
    _send(arm, arm.pid(program), signal.SIGKILL)

    def repair() -> None:
        with suppress(FileNotFoundError):  # the system was stopped
            # The file is read again: another program may have a bad parameter now.
            left = ros_yaml.read(path)
            left.pop(node, None)
            arm.system.write_parameters(left | given)

    return arm.nested.begin(("crash_loop", program), repair)


def full_disk(arm: RealArm, target: str) -> Undo:
    """Let every write of supervisord to a log fail."""
    supervisor = arm.system.supervisor()
    if supervisor is None:
        return lambda: None

    def limit(size: int | None) -> None:
        with suppress(OSError):
            _, hard = resource.prlimit(supervisor, resource.RLIMIT_FSIZE)
            resource.prlimit(supervisor, resource.RLIMIT_FSIZE, (hard if size is None else size, hard))

    limit(1)
    return arm.nested.begin(("full_disk", supervisor), lambda: limit(None))


def step_clock(arm: RealArm, target: str) -> None:
    """Step the time of day of all processes of an arm, within a second; it stays so."""
    arm.clock.step()


def _babbler(mode: str) -> Callable[[RealArm, str], Undo]:
    def start(arm: RealArm, target: str) -> Undo:
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.chaos.babbler", mode],
            cwd=processes.ROOT,
            env=arm.environment() | {"SUPERVISOR_PROCESS_NAME": BABBLER},
            stdout=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C at the terminal must not end it
        )
        return _kill(process)

    return start


def _kill(process: subprocess.Popen[bytes]) -> Undo:
    def end() -> None:
        process.kill()
        process.wait()

    return end


PROGRAMS = programs_of_manifest()

FAULT_KINDS: dict[str, FaultKind] = {
    "kill": FaultKind(_signal(signal.SIGKILL), PROGRAMS),
    "terminate": FaultKind(_signal(signal.SIGTERM), PROGRAMS),
    "stop": FaultKind(stop, PROGRAMS, (1.0, 15.0)),
    "hang": FaultKind(_signal(signal.SIGUSR1), PROGRAMS, (15.0, 15.0)),
    "raise": FaultKind(_signal(signal.SIGUSR2), PROGRAMS),
    "hog": FaultKind(hog, PROGRAMS),
    "kill_all": FaultKind(kill_all, (ALL,)),
    "kill_supervisor": FaultKind(kill_supervisor, (ALL,), (0.5, 5.0)),
    "double": FaultKind(double, PROGRAMS, (6.0, 8.0)),
    "crash_loop": FaultKind(crash_loop, tuple(PARAMETERS), (3.0, 6.0)),
    "full_disk": FaultKind(full_disk, (NO_TARGET,), (3.0, 10.0)),
    "flood": FaultKind(_babbler("flood"), (NO_TARGET,), (3.0, 6.0)),
    "babble": FaultKind(_babbler("babble"), (NO_TARGET,), (3.0, 10.0)),
    marks.STEP: FaultKind(step_clock, (NO_TARGET,)),
}
"""All faults within one host; not every machine can have the last. `partition` has those between hosts."""
