"""The bounds of deploy/quick.yaml in a short run of a real system: three releases, a kill at one of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.supervision import parameter_file
from deploy.supervision.processes import ROOT
from interfaces.topics import TURN_ON
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment, save
from tests.chaos.testbed import SCENARIO
from tests.promises.findings import HOLDS
from tests.promises.promises import CHECKERS

from .chaos_runs import ChaosRun, chaos_run

pytestmark = [pytest.mark.timed, pytest.mark.timeout(150)]

DAY, AWAKE = 7.5, 4.5  # s
LENGTH = 3 * DAY
PLAY = SCENARIO | {
    "operator": {"pressed": [{"from": 0.0, "to": AWAKE}]},
    "engines": [{"at": 1.0, "command": TURN_ON}],
    "repeat": DAY,
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> ChaosRun:
    directory: Path = tmp_path_factory.mktemp("quick")
    quick = parameter_file.load(str(ROOT / "deploy" / "quick.yaml"), "/")
    kill = PlannedFault(DAY + AWAKE, "kill", "operator_watchdog")
    save(Experiment("quick", LENGTH, PLAY, [kill], quick), directory / "schedule.yaml")
    return chaos_run(directory / "run", "--schedule", str(directory / "schedule.yaml"))


def test_engines_stop_within_the_bounds_of_quick(run: ChaosRun) -> None:
    stopped = run.finding("S1")
    assert stopped.verdict == HOLDS
    assert "allowed 1.86 s; undisturbed" in stopped.measured
    assert stopped.measured.endswith("allowed 0.5 s")


@pytest.mark.parametrize("promise", CHECKERS)
def test_no_promise_is_violated_with_quick(run: ChaosRun, promise: str) -> None:
    assert not run.findings[promise].evidence
