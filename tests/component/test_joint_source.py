from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from interfaces import robot_joints
from interfaces.service import Rejected, ServiceNode, UserError
from interfaces.topics import THETA1, THETA2
from reactive_node import stamps
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services.examples import joint_source
from services.examples.joint_source import ROBOT_JOINTS, joint_angle
from tests.component.wiring import Connect

NOT_NEWER = "elbow: not newer than the state before"


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


@pytest.mark.parametrize(
    ("at", "reason"), [(1.3, "elbow: it is 0.300 s old"), (0.9, "elbow: its clock is 0.100 s ahead of ours")]
)
def test_state_that_is_old_or_of_the_future_is_rejected(at: float, reason: str) -> None:
    assert (at, reason) in angles((0.5, state(0.5, ("elbow", 1.0))), (at, state(1.0, ("elbow", 2.0))))


def test_state_that_is_not_newer_is_rejected() -> None:
    newest, older = state(0.54, ("elbow", 1.0)), state(0.31, ("elbow", 2.0))  # their ages are just allowed
    found = angles((0.5, newest), (0.5, older), (0.6, newest))
    assert found == [(0.5, 1.0), (0.5, NOT_NEWER), (0.6, NOT_NEWER)]


def test_state_without_a_stamp_is_rejected() -> None:
    assert angles((0.1, state(0.0, ("elbow", 1.0))), until=0.9) == [(0.1, "elbow: no stamp")]


def test_old_state_that_is_rejected_makes_no_older_one_new() -> None:
    newest, old, older = (state(at, ("elbow", at)) for at in (0.5, 0.3, 0.45))
    found = angles((0.5, newest), (0.56, old), (0.6, older), until=0.9)
    assert found == [(0.5, 0.5), (0.6, "elbow: it is 0.260 s old"), (0.6, NOT_NEWER)]


@pytest.mark.parametrize("step", [0.4, 3600.0])
def test_states_count_after_the_clock_was_set_back(step: float) -> None:
    def clock(at: float) -> float:
        return 3600.0 + at - (step if at > 0.55 else 0.0)

    states = [(at, state(clock(at), ("elbow", at))) for at in (0.5, 0.6, 0.7)]
    assert angles(*states, clock=clock) == [(0.5, 0.5), (0.6, 0.6), (0.7, 0.7)]


def test_state_of_another_clock_is_rejected_without_its_age() -> None:
    other = "a simulation (use_sim_time), a record, or a wrong clock"
    for clock, way in ((1_795_905_522.0, "before"), (-1_795_905_522.0, "ahead of")):
        found = angles((0.5, state(0.5, ("elbow", 1.0))), until=0.9, clock=lambda at, by=clock: at + by)
        assert found == [(0.5, f"elbow: its time is more than a day {way} ours: {other}")]


def bare(at: float, *names: str, positions: Sequence[float] = ()) -> JointState:
    """A state that has no position for each joint."""
    return JointState(header=state(at).header, name=list(names), position=list(positions))


def test_state_of_velocities_only_is_no_bad_state() -> None:
    states = [
        (0.1 * n, bare(0.1 * n, "elbow") if n % 2 else state(0.1 * n, ("elbow", n))) for n in range(1, 5)
    ]
    assert angles(*states, until=0.9) == [(0.2, 2.0), (0.4, 4.0)]


def test_state_with_too_few_positions_is_rejected() -> None:
    found = angles((0.5, bare(0.5, "wrist", "elbow", positions=[1.0])), until=0.9)
    assert found == [(0.5, "elbow: 2 names and 1 positions")]


def named(*names: str) -> JointState:
    return state(0.5, *((name, 1.0) for name in names))


@pytest.mark.parametrize(
    ("robot", "shown"),
    [
        (bare(0.5, "elbow"), "elbow (without position)"),
        (bare(0.5, positions=[1.0]), "no names"),
        (named("left/elbow", "left/wrist"), "left/elbow, left/wrist; is it left/elbow?"),
        (named("ur_elbow", "b_elbow"), "b_elbow, ur_elbow; is it b_elbow, ur_elbow?"),
        (named("wrist"), "wrist"),
        (named(*(f"j{n}" for n in range(10))), "j0, j1, j2, j3, j4, j5, j6, j7 and 2 more"),
        (named("x" * 100_000), "x" * 40),
    ],
    ids=lambda it: it[:30] if isinstance(it, str) else "state",
)
def test_silence_reports_the_names_that_the_robot_has(robot: JointState, shown: str) -> None:
    assert angles((0.5, robot), until=1.4) == [(1.0, f"elbow: no angle for 1 s: the states have {shown}")]


ARM, SAME, HAND = ("elbow", "wrist"), ("wrist", "elbow"), ("finger",)


@pytest.mark.parametrize(
    ("layouts", "nodes", "is_told"),
    [
        ([ARM], {"driver"}, False),
        ([ARM], {"driver", "joint_state_publisher"}, True),
        ([ARM, SAME], {"driver", "joint_state_publisher"}, True),
        ([ARM, ("elbow",)], {"driver", "joint_state_publisher"}, True),
        ([ARM, HAND], {"driver", "gripper"}, False),
        ([ARM, ("elbow (without position)",)], {"driver", "motors"}, False),
        ([ARM, HAND], {"driver", "gripper", "joint_state_publisher"}, True),
        ([ARM, ("elbow",)], {"driver"}, False),
        ([HAND], {"driver", "gripper"}, False),
        ([], {"driver", "gripper"}, False),
    ],
)
def test_publishers_of_one_joint_are_named(
    layouts: list[tuple[str, ...]], nodes: set[str], is_told: bool
) -> None:
    reason = f"{', '.join(sorted(nodes))} publish states, and more than one has this joint"
    known = frozenset(map(frozenset, layouts))
    assert robot_joints.rivals("elbow", known, nodes) == (reason if is_told else "")


def test_silence_is_reported_in_each_report_until_an_angle_comes() -> None:
    silence = "elbow: no angle for 1 s"
    found = angles((1.7, state(1.7, ("elbow", 1.0))), until=2.8)
    assert found == [(1.0, silence), (1.5, silence), (1.7, 1.0), (2.7, silence)]


def test_joints_of_a_robot_become_those_of_the_arm(connect: Connect, spin_until: SpinUntil) -> None:
    wired = connect(
        joint_source.wire, inputs=[ROBOT_JOINTS], outputs=[THETA1, THETA2], theta1="shoulder", theta2="elbow"
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


@pytest.mark.parametrize(
    ("parameters", "age", "reason"),
    [
        ({}, 0.3, r"it is 0\.\d+ s old"),
        ({}, -0.15, r"its clock is 0\.\d+ s ahead of ours"),
        ({"max_age": 5.0}, 5.1, r"it is 5\.\d+ s old"),
        ({"max_age": 5.0}, 2.0, ""),
    ],
)
def test_state_counts_by_the_age_of_its_stamp(
    connect: Connect, spin_until: SpinUntil, parameters: dict[str, float], age: float, reason: str
) -> None:
    wired = connect(joint_source.wire, inputs=[ROBOT_JOINTS], outputs=[THETA1], **parameters)
    message = state(0.0, ("theta1", 1.0))
    message.header.stamp = stamps.to_message(stamps.now() - timedelta(seconds=age))
    wired.publish(ROBOT_JOINTS, message)
    if reason:
        spin_until(lambda: wired.service.health.dropped)
        assert any(re.search(f"theta1: {reason}", remark) for remark in wired.remarks())
        assert not wired.heard[THETA1.name]
    else:
        spin_until(lambda: wired.heard[THETA1.name])


@pytest.mark.parametrize("reliability", [ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE])
def test_joints_come_from_every_publisher(
    connect: Connect, spin_until: SpinUntil, reliability: ReliabilityPolicy
) -> None:
    source = replace(ROBOT_JOINTS, qos=QoSProfile(depth=1, reliability=reliability))
    wired = connect(joint_source.wire, inputs=[source], outputs=[THETA1, THETA2])

    def is_heard() -> bool:
        message = state(0.0, ("theta1", 1.0), ("theta2", 2.0))
        message.header.stamp = stamps.to_message(stamps.now())
        wired.publish(source, message)
        return bool(wired.heard[THETA1.name] and wired.heard[THETA2.name])

    spin_until(is_heard)


def test_angle_of_more_than_ten_seconds_ago_counts_for_nobody(make_node: MakeNode) -> None:
    given = [Parameter("max_age", value=10.5)]
    with pytest.raises(ParameterException):
        joint_source.wire(make_node(kind=ServiceNode, parameter_overrides=given))


def test_two_drivers_of_a_joint_are_reported_with_their_topic(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    remap = ["--ros-args", "-r", "robot/joint_states:=/ur/joint_states"]
    source = make_node("source", kind=ServiceNode, cli_args=remap)
    shown: set[tuple[str, str]] = set()
    source.health.remark = lambda *why: shown.add(why)
    joint_source.wire(source)
    drivers = [make_node(name, namespace="/ur") for name in ("driver", "joint_state_publisher")]
    outs = [it.create_publisher(JointState, "joint_states", 10) for it in drivers]
    spin_until(lambda: all(out.get_subscription_count() for out in outs))
    nodes = "/ur/driver, /ur/joint_state_publisher"
    reason = f"theta1: {nodes} publish states, and more than one has this joint"

    def is_told() -> bool:
        for out in outs:
            out.publish(JointState(name=["theta1", "theta2"], position=[0.5, 0.5]))
        return ("/ur/joint_states", reason) in shown

    spin_until(is_told)


def test_joints_that_the_arm_itself_publishes_are_refused(make_node: MakeNode) -> None:
    remapping = ["--ros-args", "-r", "robot/joint_states:=/joint_states"]
    with pytest.raises(UserError, match="/joint_states is what the arm publishes; start it in a namespace"):
        joint_source.wire(make_node(kind=ServiceNode, cli_args=remapping))
    joint_source.wire(make_node(kind=ServiceNode, namespace="/arm1", cli_args=remapping))
