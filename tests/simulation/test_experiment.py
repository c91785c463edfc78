"""Simulated experiments of the whole arm: repeatable, and judged by the same checkers as real ones."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

import pytest
import yaml
from rclpy_simulation.host import BOOT, SECOND

from deploy.supervision.manifest import Program
from deploy.supervision.processes import ROOT
from interfaces import topics
from interfaces.service import instance
from services.examples import speed_guard
from tests.chaos import schedule
from tests.chaos.schedule import AWAKE, DAY, PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.chaos.testbed import SCENARIO, sources
from tests.promises.history import ALL, CONTROLLER, NO_TARGET, OPERATOR, SWITCH
from tests.simulation import arm, people, plan
from tests.simulation.bugs import Bug, planted
from tests.simulation.faults import BAD_LINE, FAULT_KINDS
from tests.simulation.outcome import Outcome, simulate

LENGTH = 30.0  # s: four faults, and the time in which the arm recovers from the last one
EVERY = 2.5  # s between two faults


def violations(outcome: Outcome) -> dict[str, Sequence[object]]:
    return {finding.promise: finding.evidence for finding in outcome.findings if finding.evidence}


@pytest.mark.parametrize("kind", FAULT_KINDS)
def test_the_promises_hold_under_each_kind_of_fault(kind: str) -> None:
    outcome = simulate(plan.experiment(f"only {kind}", LENGTH, EVERY, [kind]))
    assert outcome.injected[kind] >= 4
    assert not violations(outcome)


@pytest.mark.parametrize("name", ["kill_watchdog", "kill_controller", "stop_controller", "kill_supervisor"])
def test_the_promises_hold_in_the_scenarios_of_the_chaos_monkey(name: str) -> None:
    faults = [
        each
        for each in schedule.SCENARIOS[name]()
        if each.target in FAULT_KINDS[each.kind].targets or each.target == NO_TARGET
    ]
    length = max(schedule.duration(faults), DAY)
    outcome = simulate(Experiment(name, length, {**SCENARIO, **sources(people.RATE)}, faults))
    assert not violations(outcome)
    assert next(finding for finding in outcome.findings if finding.promise == "S1").cases


@pytest.mark.parametrize(
    ("seconds", "lengths"),
    [
        (36.0, [36.0]),
        (600.0, [600.0]),
        (600.12, [600.12]),
        (614.9, [614.9]),
        (615.1, [600.0, 15.1]),
        (1200.0, [600.0, 600.0]),
        (1201.0, [600.0, 601.0]),
    ],
)
def test_no_experiment_is_too_short_for_an_operator(seconds: float, lengths: list[float]) -> None:
    experiments = plan.experiments("1", seconds / 3600.0, 5.0, list(FAULT_KINDS))
    assert [each.length for each in experiments] == pytest.approx(lengths)
    assert all(each.scenario["engines"] for each in experiments)


def test_a_quiet_experiment_has_output_from_every_program() -> None:
    outcome = simulate(Experiment("quiet", 10.0, SCENARIO, []))
    assert not violations(outcome)
    assert len(outcome.history.lives) == len(arm.NAMES)
    for program in arm.NAMES:
        assert outcome.history.output(program), program


def test_record_is_the_same_in_each_interpreter_and_worker() -> None:
    program = (
        "import os; from tests.simulation import plan; from tests.simulation.workers import summaries; "
        "os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:{number}]); "
        f"every = [plan.experiment(str(seed), {LENGTH}, 1.0, list(plan.FAULT_KINDS)) for seed in range(2)]; "
        "print([each.digest for each in summaries(every)])"
    )
    outputs = [
        subprocess.run(
            [sys.executable, "-c", program.replace("{number}", number)],
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": number},
            capture_output=True,
        ).stdout
        for number in ("1", "2")
    ]
    assert outputs[0].count(b"'") == 4
    assert outputs[0] == outputs[1]


def test_another_seed_gives_another_record() -> None:
    one, two = (simulate(Experiment(seed, 2.0, SCENARIO, [])) for seed in ("one", "two"))
    assert one.digest != two.digest


BRIEF = {
    "l1": SCENARIO["l1"],
    "operator": {"pressed": [{"from": 0.0, "to": 4.0}]},
    "engines": [{"at": 1.5, "command": topics.TURN_ON}],
}
"""An operator who falls asleep soon."""
ASLEEP = 4.0  # s


DEAF = Bug(CONTROLLER, "10.0, (1.0, 10.0), ", "3600.0, (1.0, 3600.0), ")
"""The controller does not turn off on its own when it hears of no operator."""


def test_a_bug_of_a_service_violates_a_promise() -> None:
    kills = [PlannedFault(ASLEEP + 1.0 + n, "kill", "operator_watchdog") for n in range(11)]
    with planted(DEAF):
        assert "S1" in violations(simulate(Experiment("bug", ASLEEP + 12.0, BRIEF, kills)))


def test_a_switch_that_never_lets_go_violates_s1() -> None:
    right = "pressed.instead_of(player.state(scenario.pressed))"
    with planted(Bug(SWITCH, right, f"{right}.filter(bool)")):
        outcome = simulate(Experiment("held", ASLEEP + 8.0, BRIEF, []))
    assert list(violations(outcome)) == ["S1"]


def test_a_second_instance_that_does_not_refuse_violates_s5(monkeypatch: pytest.MonkeyPatch) -> None:
    double = Experiment("double", 8.0, BRIEF, [PlannedFault(3.0, "double", "kinematics", 4.0)])
    assert "S5" not in violations(simulate(double))
    monkeypatch.setattr(instance, "claim", lambda node, **options: nullcontext())
    assert "S5" in violations(simulate(double))


def test_the_example_of_a_service_violates_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    guard = Program("speed_guard", speed_guard.__name__, ())
    monkeypatch.setattr(arm, "PROGRAMS", (*arm.PROGRAMS, guard))
    monkeypatch.setattr(arm, "NAMES", (*arm.NAMES, "speed_guard"))
    rate = 25.0  # Hz: twist knows no velocity of less than ten samples a second
    outcome = simulate(Experiment("guard", 40.0, {**SCENARIO, **sources(rate)}, []))
    offs = [each for each in outcome.history.stream(topics.ENGINES) if each.value == topics.TURN_OFF]
    assert offs
    assert offs[0].sent < AWAKE
    assert not violations(outcome)
    measured = next(finding.measured for finding in outcome.findings if finding.promise == "S2")
    assert re.search(r"turned off ([2-9] times|once) for a permitted reason", measured)


def is_stopped(simulated: arm.SimulatedArm) -> bool:
    process = simulated.process("velocity")
    assert process is not None
    return process.is_stopped


def is_cut(simulated: arm.SimulatedArm) -> bool:
    hosts = [simulated.simulation.host(name) for name in (arm.ROBOT, arm.CONTROL)]
    return simulated.simulation.network.is_cut(*hosts)


def is_bad(simulated: arm.SimulatedArm) -> bool:
    network = simulated.simulation.network
    return (network.loss, network.latency) == BAD_LINE


def drifts(simulated: arm.SimulatedArm) -> bool:
    host, boot = simulated.simulation.host(arm.ROBOT), BOOT
    return host.time_of_day(boot + SECOND) - host.time_of_day(boot) != SECOND


@pytest.mark.parametrize(
    ("kind", "target", "is_wrong"),
    [
        ("stop", "velocity", is_stopped),
        ("partition", OPERATOR, is_cut),
        ("bad_line", ALL, is_bad),
        ("drift_clock", NO_TARGET, drifts),
    ],
)
def test_a_fault_lasts_although_an_overlapping_one_ends(
    kind: str, target: str, is_wrong: Callable[[arm.SimulatedArm], bool], tmp_path: Path
) -> None:
    with arm.simulated_arm("1", tmp_path, SCENARIO) as simulated:
        simulated.simulation.run(3.0)
        assert not is_wrong(simulated)
        first, second = (FAULT_KINDS[kind].inject(simulated, target, 1.0) for _ in range(2))
        assert first is not None
        assert second is not None
        first()
        assert is_wrong(simulated)
        second()
        assert not is_wrong(simulated)


def test_supervisord_stays_dead_although_an_overlapping_fault_ends(tmp_path: Path) -> None:
    with arm.simulated_arm("1", tmp_path, SCENARIO) as simulated:
        first, second = (FAULT_KINDS["kill_supervisor"].inject(simulated, ALL, 1.0) for _ in range(2))
        assert first is not None
        assert second is not None
        first()
        simulated.simulation.run(3.0)
        assert not simulated.supervisor.is_alive
        second()
        simulated.simulation.run(6.0)
        assert simulated.supervisor.is_alive


def test_crash_loops_end_one_by_one(tmp_path: Path) -> None:
    def bad() -> set[str]:
        return {name for name in yaml.safe_load((tmp_path / "parameters.yaml").read_text()) if name != "/**"}

    with arm.simulated_arm("1", tmp_path, SCENARIO) as simulated:
        targets = "config_l1", "config_l2", "config_l2"
        undone = [FAULT_KINDS["crash_loop"].inject(simulated, each, 1.0) for each in targets]
        for left in ({"/config_l1", "/config_l2"}, {"/config_l2"}, {"/config_l2"}):
            assert bad() == left
            undo = undone.pop(0)
            assert undo is not None
            undo()
        assert bad() == set()


def test_a_stop_of_a_new_process_ends_although_that_of_the_old_one_lasts(tmp_path: Path) -> None:
    with arm.simulated_arm("1", tmp_path, SCENARIO) as simulated:
        simulated.simulation.run(3.0)
        FAULT_KINDS["stop"].inject(simulated, "velocity", 9.0)
        FAULT_KINDS["kill"].inject(simulated, "velocity", 0.0)
        simulated.simulation.run(6.0)
        undo = FAULT_KINDS["stop"].inject(simulated, "velocity", 1.0)
        assert undo is not None
        assert is_stopped(simulated)
        undo()
        assert not is_stopped(simulated)
