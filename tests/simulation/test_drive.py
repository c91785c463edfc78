"""The drive of the demo in virtual time: off means that the arm stands still."""

from __future__ import annotations

from bisect import bisect_right
from functools import cache
from itertools import pairwise

import pytest
import yaml

from deploy.supervision.plugin import SCENARIO
from interfaces import topics
from interfaces.sources import scenario_file
from services import engine_controller
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.history import CONTROLLER, DRIVE, WATCHDOG, History, Sample, between
from tests.simulation import people
from tests.simulation.outcome import Outcome, simulate

from .bugs import BUGS, planted

PERIOD = 1.0 / scenario_file.DRIVE_RATE
DEMO = scenario_file.load(SCENARIO)
SCENE = {
    **yaml.safe_load(SCENARIO.read_text()),
    "operator": {"pressed": [{"from": 0.0, "to": 8.0}, {"from": 24.0}]},
    "engines": [{"at": at, "command": topics.TURN_ON} for at in (3.0, 26.0)],
}
"""The demo, but its operator lets go at 8 s, and turns the engines on again at 26 s."""
KILLED = (DRIVE, "config_theta1", "config_theta2")


@cache
def played(killed: str) -> Outcome:
    """Play the scene; a program is killed while the joints move, stand, and move again."""
    kills = [PlannedFault(at, "kill", killed) for at in (5.0, 22.0, 28.0)] if killed else []
    return simulate(Experiment("drive", 32.0, SCENE, kills))


def values(history: History, topic: topics.Topic, begin: float, end: float) -> list[float]:
    return [sample.value for sample in between(history.stream(topic), begin, end)]


def test_arm_stands_still_while_the_engines_are_off_and_then_goes_on() -> None:
    history = played("").history

    for begin, end in ((0.5, 2.5), (18.5, 25.5)):
        for topic in (*topics.JOINTS, topics.EFFECTOR_POSITION):
            stood = values(history, topic, begin, end)
            assert len(set(stood)) == 1
            assert len(stood) > 0.9 * (end - begin) / PERIOD
    assert values(history, topics.EFFECTOR_SPEED, 0.0, 24.0)[-1] == 0.0
    assert len(set(values(history, topics.EFFECTOR_POSITION, 26.5, 32.0))) > 100


def latest(samples: list[Sample], time: float) -> list[float]:
    index = bisect_right(samples, time, key=lambda s: s.sent)
    return [sample.value[0] for sample in samples[max(0, index - 2) : index]]


@pytest.mark.parametrize("killed", ["", *KILLED])
def test_joints_agree_on_the_time_and_never_jump(killed: str) -> None:
    outcome = played(killed)
    times = outcome.history.stream(topics.DRIVEN_TIME)

    assert all(0.0 <= two.value[0] - one.value[0] <= 2 * PERIOD + 1e-6 for one, two in pairwise(times))
    for joint in topics.JOINTS:
        track = DEMO.configuration[joint.name]
        for sample in outcome.history.stream(joint):
            assert sample.value in [track.at(time) for time in latest(times, sample.sent)]
    assert outcome.violated() == []


@pytest.mark.parametrize("killed", KILLED)
def test_kill_of_drive_or_joint_costs_less_than_a_second_of_motion(killed: str) -> None:
    undisturbed, disturbed = (
        played(each).history.stream(topics.DRIVEN_TIME)[-1].value[0] for each in ("", killed)
    )

    # Each time, the joints begin to move with the first repetition of `on` that no `off` opposes any more.
    assert undisturbed - 1.5 < disturbed <= undisturbed + 2 * engine_controller.DEFAULTS.repeat


def test_s6_finds_a_drive_that_ignores_the_400_ms() -> None:
    # The last `on` comes late in the silence: the watchdog loses its strikes, and the controller stops.
    faults = [PlannedFault(13.0, "kill", WATCHDOG), PlannedFault(17.0, "stop", CONTROLLER, 15.0)]
    moving = {**SCENE, **people.sources(people.RATE)}
    experiment = Experiment("ignored", 24.0, moving, faults)
    assert simulate(experiment).violated() == []

    with planted(BUGS["the drive ignores the 400 ms"]):
        assert simulate(experiment).violated() == ["S6"]
