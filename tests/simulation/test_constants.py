"""Values that are published once: a process that starts later knows them, whatever the clock does."""

from __future__ import annotations

import pytest

from interfaces.topics import TURN_ON
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.history import KINEMATICS, NO_TARGET, ROBOT_STATE
from tests.promises.marks import STEP
from tests.simulation import outcome, people
from tests.simulation.arm import CONTROL, ROBOT, SimulatedArm
from tests.simulation.faults import FaultKind

SCENARIO = {
    **people.sources(people.RATE),
    "l1": 2.0,
    "l2": 3.0,
    "operator": {"pressed": [{"from": 0.0, "to": 20.0}]},
    "engines": [{"at": 1.5, "command": TURN_ON}],
}


@pytest.mark.parametrize("seconds", [-600.0, 600.0])
def test_new_reader_knows_a_constant_though_the_clock_was_set(
    seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def step(arm: SimulatedArm, target: str, duration: float) -> None:
        for host in (ROBOT, CONTROL):
            arm.simulation.host(host).step(seconds)

    monkeypatch.setitem(outcome.KINDS, STEP, FaultKind(step, (NO_TARGET,)))
    kills = [PlannedFault(8.0, "kill", each) for each in (KINEMATICS, ROBOT_STATE)]
    experiment = Experiment("set", 22.0, SCENARIO, [PlannedFault(4.0, STEP, NO_TARGET), *kills])
    found = outcome.simulate(experiment)
    assert found.violated() == []
    (recovered,) = (finding.times for finding in found.findings if finding.promise == "L1")
    assert ROBOT_STATE in recovered
