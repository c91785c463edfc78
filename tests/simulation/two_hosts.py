"""Two whole arms on two hosts that are cut from each other and healed, while their processes die.

Two hosts that start while they are cut off run two arms of one name. Each host has a drive, joints and an
operator of its own, and after the line heals, each hears the other one as well. What a host sees is judged as
one arm: its own processes, and the operators that it can hear.
"""

from __future__ import annotations

import hashlib
import math
import random
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from rclpy_simulation import Network

from deploy.supervision import parameter_file
from interfaces import topics
from tests.chaos.schedule import PlannedFault, random_faults
from tests.chaos.schedule_file import Experiment
from tests.promises.findings import Finding
from tests.promises.history import (
    ALL,
    BAD_LINE,
    CONTROLLER,
    DRIVE,
    OPERATOR,
    PARTITION,
    SWITCH,
    WATCHDOG,
    History,
    InjectedFault,
)
from tests.promises.marks import STEP
from tests.promises.promises import CHECKERS
from tests.simulation import people
from tests.simulation.arm import CONTROL, NO_PARAMETERS, ROBOT, SimulatedArm
from tests.simulation.calibration import load
from tests.simulation.faults import FAULT_KINDS
from tests.simulation.machine import simulated_services
from tests.simulation.observer import Observer

HOSTS = (ROBOT, CONTROL)
SIDE = ": "
"""In a target, between a host and its program; a target without a host concerns both."""
MOVED = tuple(joint.publishers[0] for joint in topics.JOINTS)
RUN = (SWITCH, WATCHDOG, CONTROLLER, DRIVE, *MOVED)
"""The programs of each host: all that the joints depend on."""
HEARD = [f"rt/{each.name}" for each in (topics.OPERATOR_HEARTBEAT, topics.OPERATOR_PRESENCE, topics.ENGINES)]
"""What an operator of either host says to both of them."""
JUDGED = ("S1", "S3", "S5", "S6")
KINDS = ("kill", "terminate", "stop", "slow", "raise", "kill_all", STEP, "skew_clock", "babble", BAD_LINE)
"""The random faults; those of a process hit one of the hosts."""
APART, TOGETHER = (1.0, 60.0), (1.0, 90.0)
"""For how long the hosts are cut from each other, and for how long not [s]."""
VICTIMS = (DRIVE, *MOVED)
LENGTH = 600.0  # s of an experiment
QUIET = 15.0  # s at its end without a new fault


class Play(NamedTuple):
    """What has happened: on each host, and in all."""

    histories: list[History]
    digest: str
    messages: int


def experiments(
    seed: str, hours: float, every: float, parameters: Mapping[str, Any] = NO_PARAMETERS
) -> list[Experiment]:
    """Return experiments of some hours, with a random fault in each interval of ``every`` [s]."""
    number = max(1, round(3600.0 * hours / LENGTH))
    length = 3600.0 * hours / number
    return [experiment(f"{seed} hosts {index}", length, every, parameters) for index in range(number)]


def experiment(
    seed: str, length: float, every: float, parameters: Mapping[str, Any] = NO_PARAMETERS
) -> Experiment:
    """Return an experiment in which the hosts start while they are cut from each other."""
    rng = random.Random(f"two hosts {seed}")
    table = {kind: FAULT_KINDS[kind] for kind in KINDS}
    table |= {
        kind: each._replace(targets=tuple(f"{host}{SIDE}{program}" for host in HOSTS for program in RUN))
        for kind, each in table.items()
        if SWITCH in each.targets
    }
    table["kill_all"] = table["kill_all"]._replace(targets=tuple(f"{host}{SIDE}{ALL}" for host in HOSTS))
    faults = [*random_faults(seed, length - QUIET, every=every, kinds=KINDS, table=table)]
    at = 0.0
    while at < length - QUIET:
        lasting = rng.uniform(*APART)
        faults.append(PlannedFault(round(at, 3), PARTITION, OPERATOR, round(lasting, 3)))
        # The one who moves a joint dies while the hosts discover each other.
        for _ in range(3):
            victim = f"{rng.choice(HOSTS)}{SIDE}{rng.choice(VICTIMS)}"
            faults.append(PlannedFault(round(at + lasting + rng.uniform(-1.0, 5.0), 3), "kill", victim))
        at += lasting + rng.uniform(*TOGETHER)
    faults = sorted(each for each in faults if 0.0 <= each.at < length - QUIET)
    reaction = parameter_file.reaction_to(parameters, "/")
    # The joints have the same tracks, the operators are different.
    one, two = (people.operator(name, length, reaction) for name in (seed, f"{seed} second"))
    return Experiment(seed, length, one, faults, parameters, two)


def play(experiment: Experiment) -> Play:
    """Simulate the two arms of an experiment."""
    given = load()
    scenarios = experiment.scenario, experiment.second or {}
    network = Network(latency=given.latency, discovery=given.discovery)
    arms: list[SimulatedArm] = []
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="reactive-arm-")))
        simulation = stack.enter_context(
            simulated_services(experiment.seed, network, lambda: [each.supervisor for each in arms])
        )
        if any(each.kind == PARTITION and not each.at for each in experiment.faults):
            simulation.cut(*HOSTS)  # until the end of that fault
        for host, scenario in zip(HOSTS, scenarios, strict=True):
            (directory / host).mkdir()
            start_up, parameters = given.start_up, experiment.parameters
            arms.append(
                SimulatedArm(simulation, directory / host, scenario, start_up, parameters, (host, host), RUN)
            )
        apart = _apart(experiment)
        observers = [_Witness(arm, host, apart) for arm, host in zip(arms, HOSTS, strict=True)]
        injected: list[list[InjectedFault]] = [[] for _ in arms]
        for planned in experiment.faults:
            _plan(planned, arms, injected)
        simulation.run(arms[0].origin + experiment.length)
        lives = [arm.lives() for arm in arms]
    histories = []
    # Each host may hear both operators, and a switch of the other one that was away: no silence is certain.
    for observer, faults, own in zip(observers, injected, lives, strict=True):
        histories.append(observer.history(own, faults, (), experiment.length, RUN))
    digest = hashlib.sha256("".join(each.digest for each in observers).encode()).hexdigest()
    return Play(histories, digest, sum(each.messages for each in observers))


def judge(history: History) -> list[Finding]:
    """Return the findings about the arm of a host."""
    return [CHECKERS[promise](history) for promise in JUDGED]


def _plan(planned: PlannedFault, arms: Sequence[SimulatedArm], injected: list[list[InjectedFault]]) -> None:
    """Inject a fault at its time: into the host that its target names, or into both."""
    host, _, program = planned.target.rpartition(SIDE)
    hit = [HOSTS.index(host)] if host else range(len(HOSTS))
    arm = arms[hit[0]]

    def inject() -> None:
        process = arm.process(program) if program in RUN else None
        now, pid = arm.simulation.now - arm.origin, process.pid if process else 0
        undo = FAULT_KINDS[planned.kind].inject(arm, program, planned.duration)
        for number in hit:
            fault = InjectedFault(planned.kind, program, now, now + planned.duration, pid)
            injected[number].append(fault)
        if undo is not None:
            arm.simulation.after(planned.duration, undo)

    arm.simulation.at(arm.origin + planned.at, inject)


def _apart(experiment: Experiment) -> list[tuple[float, float]]:
    """Return when no host can ever hear what is said on the other one [s].

    DDS keeps the last presence and the last commands for a reader that is cut off. When the line heals, a
    presence counts by its stamp: the operator was there.
    """
    latest = parameter_file.reaction_to(experiment.parameters, "/").controller.presence_timeout
    cuts = [each for each in experiment.faults if each.kind == PARTITION]
    return [(each.at or -math.inf, each.at + each.duration - latest) for each in cuts]


class _Witness(Observer):
    """Sees what a host can hear: its own processes, and the operators of the other one."""

    def __init__(self, arm: SimulatedArm, host: str, apart: Sequence[tuple[float, float]]) -> None:
        super().__init__(arm.simulation, arm.origin)
        self._host, self._apart = arm.simulation.host(host), apart

    def _note(self, writer: Any, sample: Any) -> None:
        if writer.participant.host is self._host or (writer.topic in HEARD and self._may_hear()):
            super()._note(writer, sample)

    def _may_hear(self) -> bool:
        now = self._simulation.now - self._origin
        return not any(begin <= now < end for begin, end in self._apart)
