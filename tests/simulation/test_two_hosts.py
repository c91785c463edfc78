"""Two whole arms on two hosts that start while they are cut from each other, in virtual time."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from interfaces import topics
from interfaces.sources import driving
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment, load, save
from tests.promises.findings import HOLDS
from tests.promises.history import DRIVE, OPERATOR, PARTITION
from tests.simulation import people, two_hosts
from tests.simulation.outcome import Outcome, simulate
from tests.simulation.two_hosts import HOSTS, JUDGED, SIDE

EVERY = 5.0  # s between two random faults
JOINT = "config_theta1"
HEALED = 30.0  # s
SCENE = {
    **people.sources(people.RATE),
    "operator": {"pressed": [{"from": 0.5, "to": 8.0}]},
    "engines": [{"at": at, "command": topics.TURN_ON} for at in (2.0, 4.0)],
}
SECOND = {**SCENE, "operator": {"pressed": [{"from": 0.5, "to": 12.0}]}}
"""Its operator lets go later. All engines are off when the hosts meet, and stay off."""


def any_drive(times: Any, source: str) -> Any:
    """Follow any drive, as a joint did."""
    return times.map(lambda time: time.seconds)


def met(seed: str, *killed: str) -> Experiment:
    """Return two hosts that meet at 30 s; then programs are killed again and again."""
    kills = [PlannedFault(HEALED + 1.0 + at, "kill", victim) for victim in killed for at in range(0, 18, 2)]
    faults = [PlannedFault(0.0, PARTITION, OPERATOR, HEALED), *sorted(kills)]
    return Experiment(seed, 60.0, SCENE, faults, second=SECOND)


KILLS = [(), *((f"{host}{SIDE}{victim}",) for host in HOSTS for victim in (DRIVE, JOINT))]


def angles(play: two_hosts.Play, host: int, begin: float) -> set[float]:
    return {each.value for each in play.histories[host].stream(topics.THETA1) if each.sent > begin}


@pytest.mark.parametrize("killed", KILLS)
def test_no_joint_moves_when_the_hosts_meet_and_drives_or_joints_die(killed: tuple[str, ...]) -> None:
    play = two_hosts.play(met("meet", *killed))

    stood = [angles(play, host, HEALED - 5.0) for host in range(len(HOSTS))]
    assert [len(each) for each in stood] == [1, 1]
    assert stood[0] != stood[1]  # the operators let go at different times
    for history in play.histories:
        assert not [finding for finding in two_hosts.judge(history) if finding.evidence]


@pytest.mark.parametrize("killed", KILLS)
def test_joints_that_follow_any_drive_are_found(killed: tuple[str, ...]) -> None:
    with mock.patch.object(driving, "followed", any_drive):
        assert simulate(met("meet", *killed)).violated() == ["S6"]


def test_command_that_arrives_when_the_line_heals_is_a_command() -> None:
    held = {"operator": {"pressed": [{"from": 0.5, "to": 60.0}]}}
    quiet = {key: value for key, value in (SCENE | held).items() if key != "engines"}
    late = {**quiet, "engines": [{"at": HEALED - 0.2, "command": topics.TURN_ON}]}
    faults = [
        PlannedFault(0.0, PARTITION, OPERATOR, 5.0),
        PlannedFault(HEALED - 5.0, PARTITION, OPERATOR, 5.0),  # DDS does not forget the other host
    ]
    play = two_hosts.play(Experiment("late", 60.0, quiet, faults, second=late))

    assert topics.ON in {each.value for each in play.histories[0].stream(topics.ENGINES_STATE)}
    for history in play.histories:
        assert not [finding for finding in two_hosts.judge(history) if finding.evidence]


def hours(seed: str, length: float) -> Outcome:
    return simulate(two_hosts.experiment(seed, length, EVERY))


@pytest.mark.parametrize("seed", ["1", "2"])
def test_the_promises_hold_on_hosts_that_are_cut_and_healed(seed: str) -> None:
    outcome = hours(seed, 300.0)

    assert [finding.promise for finding in outcome.findings] == [*JUDGED]
    assert {finding.verdict for finding in outcome.findings} == {HOLDS}
    assert outcome.injected[PARTITION] > 2
    assert outcome.injected["kill"] > 10


def test_random_cuts_find_joints_that_follow_any_drive() -> None:
    with mock.patch.object(driving, "followed", any_drive):
        assert hours("1", 180.0).violated() == ["S6"]


def test_the_same_seed_gives_the_same_record() -> None:
    assert hours("3", 60.0).digest == hours("3", 60.0).digest != hours("4", 60.0).digest


def test_a_schedule_file_keeps_both_hosts(tmp_path: Path) -> None:
    path = tmp_path / "schedule.yaml"
    experiment = met("file", f"{HOSTS[1]}{SIDE}{DRIVE}")
    save(experiment, path)
    assert load(path) == experiment


def test_hosts_start_apart_and_meet_again_and_again() -> None:
    for experiment in two_hosts.experiments("7", 0.5, EVERY):
        cuts = [each for each in experiment.faults if each.kind == PARTITION]
        assert cuts[0].at == 0.0
        assert len(cuts) > 3
        assert all(one.at + one.duration < two.at for one, two in pairwise(cuts))


def test_each_target_is_a_program_of_a_host_or_concerns_both() -> None:
    (experiment,) = two_hosts.experiments("8", 0.1, EVERY)
    named = {each.target.split(SIDE)[0] for each in experiment.faults if SIDE in each.target}
    assert named == {*HOSTS}
