from __future__ import annotations

from pathlib import Path

import pytest

from deploy.supervision.errors import DeploymentError
from tests.chaos import clock, plan
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment, save
from tests.chaos.testbed import SCENARIO, Testbed

PARAMETERS = {"/engine_controller": {"ros__parameters": {"presence_timeout": 5.0}}}


def schedule(path: Path, kind: str = "kill", target: str = "velocity") -> str:
    save(Experiment("7", 30.0, SCENARIO, [PlannedFault(6.0, kind, target)], PARAMETERS), path)
    return str(path)


def test_a_schedule_is_played_with_its_operator_parameters_and_length(tmp_path: Path) -> None:
    path = schedule(tmp_path / "schedule.yaml")
    planned = plan.plan(plan.parse(["--schedule", path]))
    assert planned.schedules == [[PlannedFault(6.0, "kill", "velocity")]]
    assert planned.length == 30.0
    assert path in planned.title
    testbed = planned.testbed(tmp_path)
    assert testbed.scenario == SCENARIO
    assert testbed.parameters_of("/") == PARAMETERS


def test_a_parameter_file_is_for_each_arm_of_a_fleet(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("velocity: {ros__parameters: {use_sim_time: false}}")
    planned = plan.plan(plan.parse(["--arms", "2", "--parameters", str(file)]))
    assert str(file) in planned.title
    assert [*planned.testbed(tmp_path).parameters_of("/arm2")] == ["/arm2/velocity"]


def test_a_fault_that_only_a_simulation_has_is_refused(tmp_path: Path) -> None:
    path = schedule(tmp_path / "schedule.yaml", "skew_clock", "operator")
    with pytest.raises(DeploymentError, match="only make simulate can inject skew_clock"):
        plan.plan(plan.parse(["--schedule", path]))


def test_a_seed_may_be_a_word() -> None:
    plans = [plan.plan(plan.parse(["--minutes", "1", "--seed", seed])) for seed in ("abc", "abc", "abd")]
    assert "seed abc," in plans[0].title
    assert plans[0].schedules == plans[1].schedules != plans[2].schedules


@pytest.fixture
def without_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(clock, "LIBRARY", tmp_path / "libfaketime")


NEEDED = "step_clock is not possible on this machine: there is no libfaketime (apt-get install libfaketime)"


@pytest.mark.usefixtures("without_library")
def test_a_step_of_the_clock_without_libfaketime_is_refused(tmp_path: Path) -> None:
    options = ["--schedule", schedule(tmp_path / "schedule.yaml", "step_clock", "nothing")]
    with pytest.raises(DeploymentError) as error:
        plan.plan(plan.parse(options))
    assert str(error.value) == NEEDED


def test_a_seed_plans_the_same_faults_without_libfaketime(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clock, "missing", lambda: "")
    options = plan.parse(["--minutes", "10", "--seed", "7"])
    (complete,) = plan.plan(options).schedules
    monkeypatch.undo()
    request.getfixturevalue("without_library")
    title, (possible,), *_ = plan.plan(options)

    assert possible == [each for each in complete if each.kind != "step_clock"]
    steps = len(complete) - len(possible)
    assert steps
    assert title.endswith(f"{steps} of step_clock left out: {NEEDED.partition(': ')[2]}")


def test_only_a_step_of_the_clock_needs_libfaketime() -> None:
    plans = [
        plan.Plan("", [[PlannedFault(5.0, kind, "nothing")]], 1.0, Testbed)
        for kind in ("flood", "step_clock")
    ]
    assert [each.steps_clock for each in plans] == [False, True]


@pytest.mark.parametrize("other", [["--scenario", "briefly"], ["--arms", "2"], ["--parameters", "mine.yaml"]])
def test_a_schedule_excludes_other_faults_parameters_and_arms(
    other: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        plan.parse(["--schedule", schedule(tmp_path / "schedule.yaml"), *other])
    assert "--schedule has faults and parameters of its own, for one arm" in capsys.readouterr().err
