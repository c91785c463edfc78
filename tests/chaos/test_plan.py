"""The plan of `make chaos` that follows from its command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.chaos import plan
from deploy.chaos.schedule import PlannedFault
from deploy.chaos.schedule_file import Shift, save
from deploy.chaos.testbed import SCENARIO
from deploy.supervision.system import DeploymentError


def schedule(path: Path, kind: str = "kill", target: str = "velocity") -> str:
    save(Shift("7", 30.0, SCENARIO, [PlannedFault(6.0, kind, target)]), path)
    return str(path)


def test_a_schedule_is_played_with_its_operator_and_its_length(tmp_path: Path) -> None:
    path = schedule(tmp_path / "schedule.yaml")
    planned = plan.plan(plan.parse(["--schedule", path]))
    assert planned.schedules == [[PlannedFault(6.0, "kill", "velocity")]]
    assert planned.length == 30.0
    assert path in planned.title
    testbed = planned.testbed(tmp_path)
    assert testbed._scenario == SCENARIO


def test_a_fault_that_only_a_simulation_has_is_refused(tmp_path: Path) -> None:
    path = schedule(tmp_path / "schedule.yaml", "skew_clock", "operator")
    with pytest.raises(DeploymentError, match="only make simulate can inject skew_clock"):
        plan.plan(plan.parse(["--schedule", path]))


@pytest.mark.parametrize("other", [["--scenario", "briefly"], ["--arms", "2"]])
def test_a_schedule_excludes_other_faults_and_arms(
    other: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        plan.parse(["--schedule", schedule(tmp_path / "schedule.yaml"), *other])
    assert "--schedule has faults of its own, for one arm" in capsys.readouterr().err
