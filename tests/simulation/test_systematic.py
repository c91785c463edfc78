from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple
from unittest import mock

import pytest

from tests.chaos.schedule import DAY
from tests.chaos.schedule_file import Experiment
from tests.simulation import systematic
from tests.simulation.arm import NAMES
from tests.simulation.outcome import simulate


class Day(NamedTuple):
    moments: list[systematic.Point]
    cases: Sequence[Experiment]
    title: str


@pytest.fixture(scope="module")
def day() -> Day:
    moments = systematic.points("1")
    with mock.patch.object(systematic, "points", {"1": moments}.__getitem__):
        return Day(moments, *systematic.cases("1"))


def test_the_cases_cover_every_service_each_kind_and_the_whole_day(day: Day) -> None:
    moments, cases, title = day
    assert {program for _, program in moments} == set(NAMES)
    singles = [experiment.faults[0] for experiment in cases if len(experiment.faults) == 1]
    assert len(singles) == len(moments) * len(systematic.FAULTS)
    assert f"{len(singles)} cases" in title
    kinds = Counter((fault.target, fault.kind) for fault in singles)
    assert set(kinds) == {(program, kind) for program in NAMES for kind in systematic.FAULTS}
    early = [fault.at for fault in singles[:200]]
    assert min(early) < 10.0
    assert max(early) > DAY - 12.0


def test_pairs_hit_the_programs_that_stop_the_engines_around_the_release(day: Day) -> None:
    pairs = [experiment.faults for experiment in day.cases if len(experiment.faults) == 2]
    assert len(pairs) == len([experiment for experiment in day.cases if len(experiment.faults) == 1]) // 3
    for one, two in pairs:
        assert {one.target, two.target} <= set(systematic.CRITICAL)
        assert systematic.RELEASE[0] - 0.1 < one.at <= two.at < systematic.RELEASE[1]


def test_a_fault_is_injected_just_before_its_moment(day: Day) -> None:
    at, program = next(point for point in day.moments if point[1] == "velocity" and point[0] > 9.0)
    experiment = day.cases[0]
    fault = systematic.PlannedFault(at - systematic.JUST_BEFORE, "kill", program)
    outcome = simulate(systematic.Experiment(experiment.seed, at + 3.0, experiment.scenario, [fault]))
    life = next(life for life in outcome.history.lives if life.program == program)
    assert life.ended is not None
    assert 0.0 < at - life.ended < 1e-7
    assert not outcome.violated()
