"""The sentinel: keeps the services alive where supervisord does not notice that they are not.

User story (ours): as a robot operator, I find a service that hangs replaced within five seconds, and one that
was given up tried again, without anybody's help; and I see on /diagnostics what happened to which process.

It is a service like the others, supervised like them. It kills what is stopped or reports no health, ends
what lives beside its supervised double, and revives what supervisord has given up, ever more patiently.
Whoever guards must not become the danger: where the network or the sentinel itself may be what fails, it
kills nothing for its silence; where supervisord is gone or does not answer, it does nothing at all.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from deploy.supervision import processes
from deploy.supervision.policy import NAME, Judge, Patience
from deploy.supervision.probe import Eyes
from deploy.supervision.system import DeploymentError, System, Watched
from interfaces import service
from interfaces.service import ServiceNode, parameter
from interfaces.topics import DIAGNOSTICS

OFTEN = 3  # restarts within a minute are a warning
MEETING = 0.3  # s after its start until it is discovered: what it says before may be lost


def states(
    programs: Iterable[Watched], reasons: Mapping[str, str], recent: Mapping[str, int], node: str
) -> list[DiagnosticStatus]:
    """The states of the processes, as they are published; ``recent``: restarts within the last minute."""
    return [_state(each, reasons.get(each.name, ""), recent.get(each.name, 0), node) for each in programs]


def _state(program: Watched, why: str, recent: int, node: str) -> DiagnosticStatus:
    good = program.state in ("STARTING", "RUNNING")
    level, message = DiagnosticStatus.OK, program.state
    if not good:
        level = DiagnosticStatus.ERROR
        message = f"{program.state} after {program.restarts} restarts {program.error}".strip()
    elif recent >= OFTEN:
        level, message = DiagnosticStatus.WARN, f"{program.state}, restarted {recent} times within a minute"
    values = {
        "process": program.name,
        "state": program.state,
        "pid": program.pid,
        "restarts": program.restarts,
        "last exit": program.exit,
        "why": why or ("" if good else program.error),
    }
    return DiagnosticStatus(
        level=level,
        name=f"{node}: {program.name}",
        message=message,
        hardware_id=socket.gethostname(),
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


@dataclass(frozen=True)
class Parameters:
    """What a user may set."""

    look: float = parameter(0.25, (0.05, 1.0), "s", "period at which the processes are observed")
    silence: float = parameter(2.7, (1.5, 60.0), "s", "a service without health for this long is killed")
    start: float = parameter(10.0, (1.0, 300.0), "s", "time of a new process until its first health")


def wire(node: ServiceNode) -> None:
    """Connect the judge with what it sees and does."""
    parameters = node.declare(Parameters)
    patience = Patience(parameters.look, parameters.silence, parameters.start)
    own = node.get_fully_qualified_name()
    namespace = node.get_namespace().rstrip("/")
    eyes = Eyes(System(Path(os.environ[processes.MARK])), os.getppid())
    judge = Judge(patience)
    heard: dict[tuple[str, int], float] = {}
    known: list[Watched] = []

    def listen(array: DiagnosticArray) -> None:
        for status in array.status:
            path, _, name = status.name.rpartition("/")
            pid = next((pair.value for pair in status.values if pair.key == "pid"), "")
            if path == namespace and pid.isdecimal():
                heard[name, int(pid)] = time.monotonic()

    def look(_: int) -> bool:
        """Look, and act; whether there is something new to tell."""
        nonlocal known
        try:
            sight = eyes.see(heard)
        except DeploymentError as error:
            node.remark(NAME, str(error))
            return False
        for action in judge.judge(sight):
            node.remark(action.program, f"{action.verb}: {action.why}")
            eyes.act(action)
        if judge.confused:
            node.remark(NAME, f"kills nothing for its silence: {judge.confused}")
        # But for its age, which is another one at each look.
        before, known = known, [program._replace(age=0.0) for program in sight.programs]
        for gone in heard.keys() - {(program.name, program.pid) for program in known}:
            del heard[gone]  # also what is of other hosts
        return known != before

    def message(_: object) -> DiagnosticArray:
        array = DiagnosticArray(status=states(known, judge.reasons, judge.recent, own))
        array.header.stamp = node.get_clock().now().to_msg()
        return array

    node.observe(DIAGNOSTICS).subscribe(listen, scheduler=node.scheduler)
    changes = rx.timer(0.0, patience.look).map(look).filter(bool)
    node.publish(DIAGNOSTICS, rx.merge(changes, rx.timer(MEETING, 1.0)).map(message))


def main() -> None:
    """Run the service."""
    service.run(NAME, wire)


if __name__ == "__main__":
    main()
