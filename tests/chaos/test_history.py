"""Targets, outputs and dependents as they follow from the manifest and the contract."""

from __future__ import annotations

import subprocess
import sys

from deploy.chaos.history import DEPENDENTS, OPERATOR, OUTPUTS
from deploy.chaos.liveness import STREAMS
from deploy.supervision import processes
from interfaces import topics

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

from deploy.chaos.history import DEPENDENTS, OUTPUTS
from deploy.chaos.liveness import STREAMS
from deploy.chaos.schedule import everything, kill_each

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
