"""An experiment: one simulated run of an arm, with its operator and its faults, judged by the promises."""

from __future__ import annotations

import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deploy.supervision.errors import DeploymentError
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.findings import Finding, merged
from tests.promises.history import SILENCE, Condition, History, InjectedFault
from tests.promises.promises import checked
from tests.simulation import people, two_hosts
from tests.simulation.arm import NAMES, ROBOT, SimulatedArm, simulated_arm
from tests.simulation.attacks import alone
from tests.simulation.calibration import Calibration
from tests.simulation.faults import ATTACK_KINDS, FAULT_KINDS
from tests.simulation.observer import Observer
from tests.simulation.viewer import view

KINDS = FAULT_KINDS | ATTACK_KINDS


@dataclass(frozen=True)
class Outcome:
    experiment: Experiment
    findings: list[Finding]
    history: History
    digest: str
    """A hash of all messages with their times."""
    messages: int

    @property
    def injected(self) -> Counter[str]:
        """How often each kind of fault was injected."""
        return Counter(fault.kind for fault in self.history.faults)

    @property
    def alone(self) -> Counter[str]:
        """How often each fail-safe turned the engines off while the two others could not."""
        return alone(self.history)

    def violated(self) -> list[str]:
        return [finding.promise for finding in self.findings if finding.evidence]


def simulate(experiment: Experiment, durations: Calibration | None = None) -> Outcome:
    """Simulate an experiment, and check the promises.

    :param durations: of a real arm; by default, those of ``calibration.json``.
    :raises DeploymentError: if the experiment has a fault that cannot be simulated, or a bad scenario.
    """
    if experiment.second:
        return _simulate_two_hosts(experiment)
    for planned in experiment.faults:
        if planned.kind not in KINDS or planned.target not in KINDS[planned.kind].targets:
            raise DeploymentError(f"a simulation has no fault {planned.kind} of {planned.target}")
    with tempfile.TemporaryDirectory(prefix="reactive-arm-") as directory:
        with simulated_arm(
            experiment.seed, Path(directory), experiment.scenario, durations, experiment.parameters
        ) as arm:
            observer = Observer(arm.simulation, arm.origin)
            arm.simulation.start(view, name="viewer", host=ROBOT)
            injected: list[InjectedFault] = []
            for planned in experiment.faults:
                arm.simulation.at(arm.origin + planned.at, _injection(arm, planned, injected))
            arm.simulation.run(arm.origin + experiment.length)
            lives = arm.lives()
        conditions = [
            Condition(SILENCE, begin, until)
            for begin, until in people.silences(experiment.scenario, experiment.length)
            if until > begin
        ]
        history = observer.history(lives, injected, conditions, experiment.length, NAMES)
    findings = [*checked(history)]
    return Outcome(experiment, findings, history, observer.digest, observer.messages)


def _simulate_two_hosts(experiment: Experiment) -> Outcome:
    histories, digest, messages = two_hosts.play(experiment)
    findings = [two_hosts.judge(history) for history in histories]
    # The history of a host that shows a violation, for the reports.
    shown = next((n for n, each in enumerate(findings) if any(it.evidence for it in each)), 0)
    together = [merged(each) for each in zip(*findings, strict=True)]
    return Outcome(experiment, together, histories[shown], digest, messages)


def _injection(arm: SimulatedArm, planned: PlannedFault, injected: list[InjectedFault]) -> Any:
    def inject() -> None:
        _, kind, target, duration = planned
        process = arm.process(target) if target in NAMES else None
        now = arm.simulation.now - arm.origin
        undo = KINDS[kind].inject(arm, target, duration)
        injected.append(InjectedFault(kind, target, now, now + duration, process.pid if process else 0))
        if undo is not None:
            arm.simulation.after(duration, undo)

    return inject
