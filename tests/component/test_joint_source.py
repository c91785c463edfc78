from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from interfaces.service import Rejected, ServiceNode, UserError
from interfaces.topics import THETA1, THETA2
from reactive_node import stamps
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services.examples import joint_source
from services.examples.joint_source import ROBOT_JOINTS, joint_angle
from tests.component.wiring import Wired


def state(stamp: float, *joints: tuple[str, float]) -> JointState:
    header = Header(stamp=Time(sec=int(stamp), nanosec=round(stamp % 1 * 1e9)))
    return JointState(header=header, name=[name for name, _ in joints], position=[it for _, it in joints])


def angles(
    *states: tuple[float, JointState], until: float = 1.4, clock: Callable[[float], float] = float
) -> list[tuple[float, Any]]:
    """Return the angles of the elbow, and the reasons of rejections, each with its time to a tenth.

    :param clock: returns what the clock of ages shows at a time [s].
    """
    scheduler = VirtualTime()

    def age(it: JointState) -> float:
        return clock(scheduler.clock) - it.header.stamp.sec - it.header.stamp.nanosec / 1e9

    recipe = joint_angle(scheduler.hot(*states), "elbow", age, max_age=0.2)
    items = scheduler.record(recipe, until=until).items
    return [(round(at, 1), it.reason if isinstance(it, Rejected) else it) for at, it in items]


def test_angle_is_that_of_the_named_joint_in_any_order() -> None:
    first = state(0.5, ("wrist", 1.0), ("elbow", 2.0))
    second = state(0.6, ("elbow", 3.0), ("wrist", 1.0))
    other = state(0.7, ("wrist", 1.0))
    assert angles((0.5, first), (0.6, second), (0.7, other)) == [(0.5, 2.0), (0.6, 3.0)]


@pytest.mark.parametrize(("at", "reason"), [(1.3, "elbow: 0.300 s old"), (0.9, "elbow: -0.100 s old")])
def test_state_that_is_old_or_of_the_future_is_rejected(at: float, reason: str) -> None:
    assert (at, reason) in angles((0.5, state(0.5, ("elbow", 1.0))), (at, state(1.0, ("elbow", 2.0))))


def test_state_that_is_not_newer_is_rejected() -> None:
    newest, older = state(0.54, ("elbow", 1.0)), state(0.31, ("elbow", 2.0))  # their ages are just allowed
    reason = "elbow: not newer than the state before"
    assert angles((0.5, newest), (0.5, older), (0.6, newest)) == [(0.5, 1.0), (0.5, reason), (0.6, reason)]


@pytest.mark.parametrize("step", [0.4, 3600.0])
def test_states_count_after_the_clock_was_set_back(step: float) -> None:
    def clock(at: float) -> float:
        return 3600.0 + at - (step if at > 0.55 else 0.0)

    states = [(at, state(clock(at), ("elbow", at))) for at in (0.5, 0.6, 0.7)]
    assert angles(*states, clock=clock) == [(0.5, 0.5), (0.6, 0.6), (0.7, 0.7)]


def test_state_without_positions_is_rejected() -> None:
    bare = JointState(header=Header(stamp=Time(sec=0, nanosec=500_000_000)), name=["elbow"])
    assert angles((0.5, bare), until=0.9) == [(0.5, "elbow: not each joint has a position")]


def test_silence_is_told_in_each_report_until_an_angle_comes() -> None:
    silence = "elbow: no angle for 1 s"
    found = angles((1.7, state(1.7, ("elbow", 1.0))), until=2.8)
    assert found == [(1.0, silence), (1.5, silence), (1.7, 1.0), (2.7, silence)]


def test_joints_of_a_robot_become_those_of_the_arm(make_node: MakeNode, spin_until: SpinUntil) -> None:
    wired = Wired(
        make_node,
        spin_until,
        joint_source.wire,
        inputs=[ROBOT_JOINTS],
        outputs=[THETA1, THETA2],
        theta1="shoulder",
        theta2="elbow",
    )
    message = state(0.0, ("elbow", 2.0), ("shoulder", 1.0))
    message.header.stamp = stamps.to_message(stamps.now())
    wired.publish(ROBOT_JOINTS, message)
    spin_until(lambda: wired.heard[THETA1.name] and wired.heard[THETA2.name])
    message.position = [math.nan, math.inf]
    message.header.stamp = stamps.to_message(stamps.now())
    wired.publish(ROBOT_JOINTS, message)
    spin_until(lambda: wired.service.health.dropped == 2)

    assert [[it.data for it in wired.heard[topic.name]] for topic in (THETA1, THETA2)] == [[1.0], [2.0]]
    (remarks,) = wired.remarks()
    assert "theta1: inf is not finite" in remarks
    assert "theta2: nan is not finite" in remarks


def test_joints_that_the_arm_itself_publishes_are_refused(make_node: MakeNode) -> None:
    remapping = ["--ros-args", "-r", "robot/joint_states:=/joint_states"]
    with pytest.raises(UserError, match="/joint_states is what the arm publishes; start it in a namespace"):
        joint_source.wire(make_node(kind=ServiceNode, cli_args=remapping))
    joint_source.wire(make_node(kind=ServiceNode, namespace="/arm1", cli_args=remapping))
