from __future__ import annotations

import itertools
from functools import partial
from pathlib import Path

import yaml

from deploy.supervision.reaction import reaction
from interfaces import topics
from interfaces.sources.scenario_file import load
from tests.simulation import people

operator = partial(people.operator, reaction=reaction({}))


def test_the_operator_of_a_seed_is_always_the_same() -> None:
    assert operator("1", 600.0) == operator("1", 600.0) != operator("2", 600.0)


def test_operators_hold_hammer_and_sleep(tmp_path: Path) -> None:
    holds, breaks = [], []
    for seed in range(20):
        pressed = operator(str(seed), 600.0)["operator"]["pressed"]
        holds += [each["to"] - each["from"] for each in pressed]
        breaks += [two["from"] - one["to"] for one, two in itertools.pairwise(pressed)]
    assert min(holds) < 0.1
    assert max(holds) > 50.0
    assert min(breaks) > 0.0
    assert any(2.5 < each < 4.0 for each in breaks)
    assert max(breaks) > 20.0


def test_an_operator_is_a_scenario_in_which_only_the_watchdog_turns_off(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump(operator("3", 300.0)))
    scenario = load(path)
    assert scenario.commands is not None
    assert {command for _, command in scenario.commands.items} == {topics.TURN_ON}


def test_the_silences_are_the_times_between_the_presses() -> None:
    scenario = {"operator": {"pressed": [{"from": 1.0, "to": 2.0}, {"from": 5.0}]}}
    assert list(people.silences(scenario, 9.0)) == [(0.0, 1.0), (2.0, 5.0), (9.0, 9.0)]


def test_the_silences_repeat_with_the_scenario() -> None:
    scenario = {"operator": {"pressed": [{"from": 1.0, "to": 2.0}]}, "repeat": 5.0}
    assert list(people.silences(scenario, 9.0)) == [(0.0, 1.0), (2.0, 6.0), (7.0, 9.0)]


def test_without_an_operator_all_is_silence() -> None:
    assert list(people.silences({}, 9.0)) == [(0.0, 9.0)]
