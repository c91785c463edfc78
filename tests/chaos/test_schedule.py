from __future__ import annotations

from itertools import pairwise

import pytest

from tests.chaos import schedule
from tests.chaos.faults import FAULT_KINDS, PROGRAMS
from tests.promises.limits import HUNG, MEDIAN


def test_only_the_same_seed_gives_the_same_schedule() -> None:
    assert schedule.random_faults(7, 300.0) == schedule.random_faults(7, 300.0)
    assert schedule.random_faults(7, 300.0) != schedule.random_faults(8, 300.0)


def test_one_random_fault_in_each_interval_in_order() -> None:
    times = [planned.at for planned in schedule.random_faults(1, 600.0, every=5.0)]
    assert len(times) == 119
    assert times == sorted(times)


def test_random_faults_cover_all_kinds_and_programs() -> None:
    planned = [each for seed in range(3) for each in schedule.random_faults(seed, 600.0)]
    assert {each.kind for each in planned} == set(FAULT_KINDS)
    assert {each.target for each in planned} >= set(PROGRAMS)


def test_random_faults_have_only_the_given_kinds() -> None:
    planned = schedule.random_faults(3, 600.0, kinds=["kill", "stop"])
    assert {each.kind for each in planned} == {"kill", "stop"}


@pytest.mark.parametrize("name", schedule.SCENARIOS)
def test_scenarios_inject_known_faults_into_their_targets(name: str) -> None:
    planned = schedule.SCENARIOS[name]()
    assert planned
    for each in planned:
        assert each.target in FAULT_KINDS[each.kind].targets


def test_everything_injects_each_fault_into_each_target() -> None:
    planned = {(each.kind, each.target) for each in schedule.everything()}
    assert planned == {(kind, target) for kind, fault in FAULT_KINDS.items() for target in fault.targets}


def test_kill_each_kills_every_program_twenty_times() -> None:
    killed = [each.target for each in schedule.kill_each()]
    assert {program: killed.count(program) for program in PROGRAMS} == dict.fromkeys(PROGRAMS, 20)


def test_brief_run_kills_every_program_three_times_before_the_sleep() -> None:
    killed = [each.target for each in schedule.briefly() if each.at % schedule.DAY < schedule.AWAKE]
    assert {program: killed.count(program) for program in PROGRAMS} == dict.fromkeys(PROGRAMS, 3)


def test_various_faults_kill_every_program_so_that_l1_is_judged() -> None:
    planned = schedule.variously()
    kills = [each for each in planned if each.kind == "kill"]
    assert {each.target for each in kills} == set(PROGRAMS)
    after = next(each.at for each in planned if each.kind == "kill_all")
    assert not [each for each in kills if after <= each.at <= after + HUNG]  # L1 does not judge them


def test_a_killed_program_has_time_to_restart_before_the_next_kill() -> None:
    for planned in (schedule.kill_each(), schedule.briefly()):
        assert min(two.at - one.at for one, two in pairwise(planned)) >= MEDIAN
