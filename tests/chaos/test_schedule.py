"""What the monkey plans."""

from __future__ import annotations

import pytest

from deploy.chaos import schedule
from deploy.chaos.faults import FAULTS
from deploy.chaos.history import PROGRAMS


def test_the_same_seed_gives_the_same_schedule_and_another_one_another() -> None:
    assert schedule.monkey(7, 300.0) == schedule.monkey(7, 300.0)
    assert schedule.monkey(7, 300.0) != schedule.monkey(8, 300.0)


def test_the_monkey_throws_a_fault_each_so_many_seconds_in_order() -> None:
    times = [planned.at for planned in schedule.monkey(1, 600.0, every=5.0)]
    assert len(times) == 119
    assert times == sorted(times)


def test_in_ten_minutes_the_monkey_tries_nearly_everything() -> None:
    planned = [each for seed in range(3) for each in schedule.monkey(seed, 600.0)]
    assert {each.kind for each in planned} == set(FAULTS)
    assert {each.target for each in planned} >= set(PROGRAMS)


def test_the_monkey_keeps_to_the_kinds_and_targets_that_it_is_given() -> None:
    planned = schedule.monkey(3, 600.0, kinds=["kill", "stop"], targets=["kinematics", "velocity"])
    assert {(each.kind, each.target) for each in planned} == {
        (kind, target) for kind in ("kill", "stop") for target in ("kinematics", "velocity")
    }


@pytest.mark.parametrize("name", schedule.NAMED)
def test_every_scenario_has_known_faults_for_targets_they_apply_to(name: str) -> None:
    planned = schedule.NAMED[name]()
    assert planned
    for each in planned:
        assert each.target in FAULTS[each.kind].targets


def test_everything_is_every_fault_for_every_program_it_applies_to() -> None:
    planned = {(each.kind, each.target) for each in schedule.everything()}
    assert planned == {(kind, target) for kind, fault in FAULTS.items() for target in fault.targets}


def test_kill_each_kills_every_program_twenty_times() -> None:
    killed = [each.target for each in schedule.kill_each()]
    assert {program: killed.count(program) for program in PROGRAMS} == dict.fromkeys(PROGRAMS, 20)
