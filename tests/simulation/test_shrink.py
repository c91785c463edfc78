from __future__ import annotations

from pathlib import Path

import pytest

from deploy.supervision.errors import DeploymentError
from tests.chaos import schedule_file
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.chaos.testbed import SCENARIO
from tests.simulation.bugs import planted
from tests.simulation.outcome import simulate
from tests.simulation.shrink import shrink
from tests.simulation.test_experiment import ASLEEP, BRIEF, DEAF


def test_a_schedule_is_shrunk_to_the_faults_that_violate_the_promise(tmp_path: Path) -> None:
    others = [PlannedFault(2.0, "kill", "velocity"), PlannedFault(3.0, "terminate", "config_l1")]
    kills = [PlannedFault(ASLEEP + 1.0 + 4 * n, "kill", "operator_watchdog") for n in range(3)]
    path = tmp_path / "small.yaml"
    left: list[int] = []
    with planted(DEAF):
        outcome = simulate(Experiment("bug", ASLEEP + 15.0, BRIEF, [*others, *kills]))
        assert "S1" in outcome.violated()
        small = shrink(outcome, left.append)
        schedule_file.save(small.experiment, path)
        again = simulate(schedule_file.load(path))
    assert "S1" in small.violated()
    assert {each.target for each in small.experiment.faults} == {"operator_watchdog"}
    assert left[-1] == len(small.experiment.faults) < len(kills) + 1
    assert again.digest == small.digest


FAULT = "{{seed: 1, length: 5, scenario: {{}}, faults: [{{{}}}]}}"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "no schedule"),
        ("faults: 3", "no schedule"),
        ("seed: 1\nlength: x\nscenario: {}\nfaults: []", "length: 'x' is no time in s"),
        ("seed: 1\nlength: .inf\nscenario: {}\nfaults: []", "length: inf is no time in s"),
        ("seed: 1\nlength: -1.0\nscenario: {}\nfaults: []", "length: -1.0 is no time in s"),
        (
            f"seed: 1\nlength: 1{'0' * 400}\nscenario: {{}}\nfaults: []",
            r"length: '1000000.*0' is no time in s",
        ),
        ("seed: 1\nlength: 5\nscenario: much\nfaults: []", "scenario: 'much' is no mapping"),
        ("seed: 1\nlength: 5\nfaults: []", "scenario"),
        ("seed: 1\nlength: 5\nscenario: {}", "faults"),
        (FAULT.format("at: abc, kind: kill, target: all"), "at: 'abc' is no time in s"),
        (FAULT.format("at: .nan, kind: kill, target: all"), "at: nan is no time in s"),
        (FAULT.format("at: -1, kind: kill, target: all"), "at: -1 is no time in s"),
        (FAULT.format("at: 1, kind: kill, target: all, duration: .inf"), "duration: inf is no time in s"),
        (FAULT.format("at: 1, kind: [], target: all"), r"kind: \[\] is no name"),
        (FAULT.format("at: 1, kind: kill, target: 7"), "target: 7 is no name"),
        (FAULT.format("at: 1, kind: kill, target: all, why: x"), "why"),
        ("[1]", "no schedule"),
        ("seed: 1\nlength: 5\nscenario: {}\nfaults: [{at: 1, kind: kill}]", "target"),
        ("{", "no schedule"),
        ("seed: &a 1\nlength: *a", "line 2, column 9: the alias 'a' is refused"),
        ("seed: " + 99 * "[", "line 1, column 38: is nested more than 32 levels deep"),
    ],
)
def test_a_bad_schedule_is_one_line(content: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(content)
    with pytest.raises(DeploymentError, match=reason) as error:
        schedule_file.load(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("kind", "target"), [("magic", "all"), ("kill", "moon"), ("full_disk", "nothing")])
def test_a_fault_that_cannot_be_simulated_is_named(kind: str, target: str) -> None:
    with pytest.raises(DeploymentError, match=f"no fault {kind} of {target}"):
        simulate(Experiment("1", 5.0, SCENARIO, [PlannedFault(1.0, kind, target)]))


def test_an_error_of_the_scenario_is_one_line() -> None:
    with pytest.raises(DeploymentError, match=r"the scenario has an error: .*theta1") as error:
        simulate(Experiment("1", 5.0, {"theta1": "much"}, []))
    assert "\n" not in str(error.value)
