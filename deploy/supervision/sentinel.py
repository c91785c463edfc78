"""The sentinel: replaces services that hang, which supervisord does not notice.

User story (ours): as a robot operator, I find a hanging service replaced within five seconds, and a service
that supervisord has given up started again, without help; I see on /diagnostics why and how each process
ended; and I am warned while the machine is about to harm the arm (machine.py).

It is a service like the others, and supervised like them. It kills processes that are stopped or whose loop
does not turn (interfaces/service/beats.py), later those whose reports of health nobody hears, and duplicates
of supervised processes; it revives programs that supervisord has given up, with growing delay. The sentinel
fails passive: where the machine, the network or the sentinel itself may have failed, it kills no silent
service; where supervisord is gone or does not answer, it does nothing at all. It follows the steady clock:
simulated time may stand still.

Where systemd has started the arm, the sentinel notifies it when all services are up, and each second that it
observes them and hears itself: systemd restarts an arm whose supervisord hangs.
"""

from __future__ import annotations

import os
import re
import signal
import socket
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from deploy.supervision import manifest, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.flood import Flood
from deploy.supervision.machine import FLOOD, Machine, figures
from deploy.supervision.manifest import SENTINEL
from deploy.supervision.policy import Action, Observation, Policy, Timeouts
from deploy.supervision.probe import Probe, is_here
from deploy.supervision.service_manager import ALIVE, READY, notify
from deploy.supervision.supervisord import Program, Supervisord
from interfaces import service
from interfaces.limits import AWAY, PID, PROCESS, RESTARTS, UPTIME, seconds, whole
from interfaces.service import ServiceNode, parameter
from interfaces.service.health import healths
from interfaces.topics import DIAGNOSTICS
from reactive_node import stamps

MANY_RESTARTS = 3  # within a minute: a warning
DISCOVERY = 0.3  # s until other nodes have discovered this one; earlier messages may be lost


def states(
    programs: Iterable[Program], reasons: Mapping[str, str], recent_restarts: Mapping[str, int], node: str
) -> list[DiagnosticStatus]:
    """The states of the processes as a node publishes them on /diagnostics."""
    return [
        _state(each, reasons.get(each.name, ""), recent_restarts.get(each.name, 0), node) for each in programs
    ]


def reported(message: DiagnosticArray, namespace: str) -> list[Program]:
    """Return the states in a message that a sentinel of a namespace has published, without errors."""
    node = re.compile(rf"{re.escape(namespace)}/{SENTINEL}(_\w+)?")
    found = []
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        name, _, process = status.name.partition(": ")
        if process == values.get(PROCESS) and node.fullmatch(name):
            with suppress(KeyError, ValueError):  # not a report of ours
                found.append(_program(values, status.hardware_id))
    return found


def _program(values: Mapping[str, str], host: str) -> Program:
    return Program(
        name=values[PROCESS],
        state=values["state"],
        pid=whole(values[PID]),
        uptime=seconds(values[UPTIME]),
        restarts=whole(values[RESTARTS]),
        exit=values["last exit"],
        error="",
        away=seconds(values[AWAY]),
        host=host,
    )


def _state(program: Program, reason: str, recent_restarts: int, node: str) -> DiagnosticStatus:
    good = program.state in ("STARTING", "RUNNING")
    level, message = DiagnosticStatus.OK, program.state
    if not good:
        level = DiagnosticStatus.ERROR
        message = f"{program.state} after {program.restarts} restarts {program.error}".strip()
    elif recent_restarts >= MANY_RESTARTS:
        level = DiagnosticStatus.WARN
        message = f"{program.state}, restarted {recent_restarts} times within a minute"
    values = {
        PROCESS: program.name,
        "state": program.state,
        PID: program.pid,
        RESTARTS: program.restarts,
        UPTIME: f"{program.uptime:.3f}",
        "last exit": program.exit,
        AWAY: f"{program.away:.3f}",
        "why": reason or ("" if good else program.error),
    }
    return DiagnosticStatus(
        level=level,
        name=f"{node}: {program.name}",
        message=message,
        hardware_id=socket.gethostname(),
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


def carry_out(action: Action, run: Path, supervisord: Supervisord) -> None:
    """Carry out an action, unless its process has changed meanwhile, or supervisord does not answer."""
    with suppress(DeploymentError):  # the next observation shows whether it worked
        if action.verb == "kill":
            supervisord.watch()  # a supervisord that hangs would not replace the process
            processes.send_signal(run, action.program, action.pid, signal.SIGKILL)
        else:
            supervisord.revive(action.program)


@dataclass(frozen=True)
class Parameters:
    period: float = parameter(Timeouts.period, (0.05, 0.5), "s", "period at which the processes are observed")
    health_timeout: float = parameter(
        Timeouts.health,
        (2.7, 3.3),
        "s",
        "a service whose loop shows no sign of life for this long is killed",
    )
    start_timeout: float = parameter(
        Timeouts.start,
        (5.0, 300.0),
        "s",
        "time of a new process until its first sign of life, and of a mute one",
    )


def wire(node: ServiceNode) -> None:
    """Connect probe, policy and actions: observe, decide, act, publish."""
    parameters = node.declare(Parameters)
    timeouts = Timeouts(parameters.period, parameters.health_timeout, parameters.start_timeout)
    run, supervisord = Path(os.environ[processes.MARK]), Supervisord(os.getppid())
    probe, policy, machine = Probe(run, supervisord), Policy(timeouts), Machine(run, timeouts.period)
    own_name, ours = node.get_fully_qualified_name(), {program.name for program in manifest.programs()}
    namespace = node.get_namespace().rstrip("/")
    flood = Flood(node, {f"{namespace}/{each.name}" for each in manifest.everywhere()})

    def hear(message: DiagnosticArray) -> None:
        flood.hear(message)
        reports = healths(message, namespace)
        probe.hear(reports)
        for program, health in reports.items():
            if program in ours and not is_here(health.host):
                node.remark(program, f"it runs on host {health.host} as well")

    def observe(_: int) -> Observation | None:
        warnings = machine.warnings(figures(run))
        if lost := flood.look():
            warnings[DIAGNOSTICS.name] = lost
        node.health.standing = warnings
        try:
            return replace(probe.observe(), flood=lost or warnings.get(FLOOD, ""))
        except DeploymentError as error:
            machine.skip()
            node.remark(SENTINEL, str(error))
            return None

    def act(actions: list[Action]) -> None:
        for action in actions:
            node.remark(action.program, f"{action.verb}: {action.reason}")
            carry_out(action, run, supervisord)
        if policy.kill_inhibited_by:
            node.remark(SENTINEL, f"kills no silent service: {policy.kill_inhibited_by}")
        for program in policy.delayed:
            node.remark(program, "its loop is late, because the machine or a flood keeps it from running")

    def message(programs: list[Program]) -> DiagnosticArray:
        array = DiagnosticArray(status=states(programs, policy.reasons, policy.recent_restarts, own_name))
        array.header.stamp = stamps.to_message(stamps.now())
        return array

    # One wake-up for all reports and the processes: a dozen services report each second.
    scheduler = node.steady_scheduler
    looks = rx.timer(0.0, timeouts.period, scheduler).share()
    messages = node.observe_buffered(DIAGNOSTICS, looks, flood.overflow)
    attempts = looks.map(observe).share()
    observations = attempts.filter(lambda it: it is not None)
    programs = observations.map(lambda observation: observation.programs)
    changed = programs.distinct_until_changed(lambda each: [program._replace(uptime=0.0) for program in each])
    # A failed attempt ends the repetition: old states must not look fresh.
    latest = rx.timer(DISCOVERY, 1.0, scheduler).with_latest_from(attempts).map(lambda pair: pair[1])
    fresh = latest.filter(lambda it: it is not None).share()
    repeated = fresh.map(lambda observation: observation.programs)
    ready = observations.filter(lambda observation: observation.is_complete).take(1)
    alive = fresh.filter(lambda _: policy.hears_itself)

    messages.subscribe(hear, scheduler=scheduler)
    observations.map(policy.decide).subscribe(act, scheduler=scheduler)
    ready.subscribe(lambda _: notify(READY), scheduler=scheduler)
    alive.subscribe(lambda _: notify(ALIVE), scheduler=scheduler)
    node.publish(DIAGNOSTICS, rx.merge(changed, repeated).map(message))


if __name__ == "__main__":
    if processes.MARK not in os.environ:
        service.refuse(SENTINEL, "runs only under supervisord: make start")
    service.run(SENTINEL, wire)
