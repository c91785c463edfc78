"""What a history has, and targets, outputs and dependents as they follow from manifest and contract."""

from __future__ import annotations

import subprocess
import sys

import pytest

from deploy.supervision import processes
from interfaces import topics
from tests.promises.history import (
    ALL,
    BAD_LINE,
    CONDITIONS,
    DEPENDENTS,
    DRIVE,
    FALSE_PRESENCE,
    HOLD,
    NO_TARGET,
    OPERATOR,
    OUTPUTS,
    PARTITION,
    STUCK_DRIVE,
    History,
    InjectedFault,
    Life,
    Sample,
    between,
    gaps,
    merged,
    programs_of_manifest,
    running,
    target_name,
)
from tests.promises.liveness import STREAMS

EXPECTED = {
    "config_l1": topics.L1,
    "config_l2": topics.L2,
    "config_theta1": topics.THETA1,
    "config_theta2": topics.THETA2,
    "dead_mans_switch": topics.OPERATOR_HEARTBEAT,
    "kinematics": topics.EFFECTOR_POSITION,
    "velocity": topics.EFFECTOR_SPEED,
    "robot_state": topics.JOINT_STATES,
    "operator_watchdog": topics.OPERATOR_PRESENCE,
    "engine_controller": topics.ENGINES_STATE,
}


def test_output_of_a_program_is_its_first_topic() -> None:
    assert {program: OUTPUTS.get(program) for program in EXPECTED} == EXPECTED


def test_presence_and_health_are_too_slow_for_l2() -> None:
    assert set(EXPECTED) - set(STREAMS) == {"operator_watchdog"}
    assert "sentinel" not in STREAMS


def test_dependents_follow_the_contract() -> None:
    assert "velocity" in DEPENDENTS["kinematics"]
    assert "operator_watchdog" in DEPENDENTS["dead_mans_switch"]
    assert set(DEPENDENTS[OPERATOR]) >= {"dead_mans_switch", "operator_watchdog"}
    assert not DEPENDENTS["config_l1"]  # kinematics has other sources


NEW_SERVICES = """
import math
from dataclasses import replace
from deploy.supervision import manifest
from interfaces import topics

guard = replace(topics.ENGINES, name="guard/alarm", publishers=("guard",))
acceleration = replace(
    topics.EFFECTOR_SPEED, name="acceleration", publishers=("accelerometer",), follows="effector/speed"
)
shared = replace(topics.OPERATOR_HEARTBEAT, publishers=("dead_mans_switch", "guard"))
old = (topic for topic in topics.CONTRACT if topic is not topics.OPERATOR_HEARTBEAT)
topics.CONTRACT = (*old, shared, guard, acceleration)
new = [manifest.Program(name, "services.velocity", ()) for name in ("guard", "accelerometer")]
programs = (*manifest.programs(), *new)
manifest.programs = lambda: programs

from tests.promises.history import DEPENDENTS, OUTPUTS
from tests.promises.liveness import STREAMS
from tests.chaos.schedule import everything, kill_each

assert OUTPUTS["dead_mans_switch"] is shared
assert "guard" not in OUTPUTS  # its own topic reports single events: its health shows that it works
assert OUTPUTS["accelerometer"] is acceleration
assert "accelerometer" in STREAMS
assert DEPENDENTS["kinematics"] == ("velocity", "accelerometer")
for program in ("guard", "accelerometer"):
    assert ("kill", program) in {(each.kind, each.target) for each in everything()}
    assert program in {each.target for each in kill_each()}
"""


def test_new_services_need_no_change_in_the_chaos_tools() -> None:
    subprocess.run([sys.executable, "-c", NEW_SERVICES], cwd=processes.ROOT, check=True)


def test_names_in_schedules_and_records_stay() -> None:
    assert (OPERATOR, ALL, NO_TARGET) == ("operator", "all", "nothing")
    assert CONDITIONS == ("overload", "loss", "silence")
    assert DRIVE in programs_of_manifest()
    assert (PARTITION, BAD_LINE, HOLD) == ("partition", "bad_line", "hold")
    assert (FALSE_PRESENCE, STUCK_DRIVE) == ("false_presence", "stuck_drive")


def test_fault_hits_no_process_and_no_clock_unless_it_says_so() -> None:
    fault = InjectedFault("flood", NO_TARGET, 1.0, 2.0)
    assert (fault.pid, fault.ahead) == (0, 0.0)


def test_target_has_a_name_for_a_reader() -> None:
    names = [target_name(target) for target in (ALL, NO_TARGET, "velocity")]
    assert names == ["(whole arm)", "(no target)", "velocity"]


def test_merged_intervals_that_touch_stay_apart() -> None:
    assert merged([(4.0, 5.0), (1.0, 3.0), (2.0, 2.5), (2.9, 4.0), (5.0, 6.0)]) == [
        (1.0, 4.0),
        (4.0, 5.0),
        (5.0, 6.0),
    ]


@pytest.mark.parametrize(
    ("kind", "target", "pid", "end"),
    [
        *((kind, "velocity", 5, 3.0) for kind in ("stop", "hang", "hog", "slow")),
        ("partition", "velocity", 5, 4.0),
        ("stop", "velocity", 6, 4.0),
        ("stop", "velocity", 7, 4.0),
        ("hang", "velocity", 6, 10.0),
        ("hang", "velocity", 7, 9.0),
        ("hang", "kinematics", 5, 4.0),
        ("stop", "kinematics", 5, 4.0),
    ],
)
def test_suspension_matters_until_its_process_is_gone(kind: str, target: str, pid: int, end: float) -> None:
    lives = [
        Life("velocity", 5, 0.0, 3.0),
        Life("velocity", 6, 0.0, None),
        Life("velocity", 7, 0.0, 9.0),
    ]
    assert History(10.0, lives=lives).effect_end(InjectedFault(kind, target, 2.0, 4.0, pid)) == end


def test_lives_of_a_program_are_those_without_an_older_one_that_lasts() -> None:
    lives = [
        Life("velocity", 1, 0.0, 5.0),
        Life("velocity", 2, 1.0, 2.0),  # ended while the first lived on
        Life("velocity", 3, 1.0, 5.0),
        Life("velocity", 4, 5.0, None),
        Life("velocity", 5, 6.0, 7.0),  # ended while the fourth lived on
        Life("velocity", 6, 6.0, None),
        Life("velocity", 7, 5.0, None),
        Life("kinematics", 8, 0.0, None),
    ]
    history = History(10.0, lives=lives)
    assert [life.pid for life in history.lives_of("velocity")] == [1, 3, 4, 7]


def test_stop_may_last_beyond_the_end_of_the_record() -> None:
    history = History(3.0, lives=[Life("velocity", 6, 0.0, None)])
    assert history.effect_end(InjectedFault("stop", "velocity", 2.0, 4.0, 6)) == 4.0


def test_last_report_of_a_parameter_counts() -> None:
    reports = [("velocity", 5, ("rate", 1.0), ("window", 3)), ("velocity", 6, ("rate", 2.0)), ("drive", 7)]
    health = [Sample(float(at), float(at), report) for at, report in enumerate(reports)]
    parameters = History(9.0, {"/diagnostics": health}).parameters
    assert parameters == {"velocity": {"rate": 2.0, "window": 3}, "drive": {}}


@pytest.mark.parametrize(("driven", "lacked"), [([], {DRIVE, "velocity"}), ([1.0], {"velocity"})])
def test_arm_lacks_the_programs_of_another_host_and_an_idle_drive(
    driven: list[float], lacked: set[str]
) -> None:
    times = [Sample(at, at, (at, "host")) for at in driven]
    history = History(9.0, {"driven_time": times}, programs=(DRIVE, "kinematics"))
    assert {each for each in (DRIVE, "kinematics", "velocity") if history.lacks(each)} == lacked


def test_engines_run_until_the_next_state_or_the_timeout_of_the_drive() -> None:
    states = [(1.0, "on"), (1.25, "on"), (1.5, "off"), (3.0, "on"), (5.0, "off"), (8.75, "on")]
    stream = [Sample(at, at, state) for at, state in states]
    runs = [(1.0, 1.25), (1.25, 1.5), (3.0, 3.4), (8.75, 9.0)]
    assert [*running(History(9.0, {"engines/state": stream}))] == runs


def test_output_of_a_program_without_one_is_its_health() -> None:
    health = [Sample(1.0, 1.0, ("sentinel", 5)), Sample(1.5, 1.5, ("velocity", 6))]
    assert History(9.0, {"/diagnostics": health}).output("sentinel") == health[:1]


def test_intervals_between_times() -> None:
    assert [*gaps([1.0, 2.0, 2.0, 9.0], 0.0, 4.0)] == [(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)]
    assert [*gaps([], 3.0, 3.0)] == []


def test_samples_between_two_times_include_those_at_the_times() -> None:
    samples = [Sample(at, at, None) for at in (1.0, 2.0, 3.0, 4.0)]
    assert between(samples, 2.0, 3.0) == samples[1:3]
