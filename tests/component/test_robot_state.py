from __future__ import annotations

import itertools
import math
import re
import subprocess
import sys
from collections.abc import Callable
from datetime import timedelta
from typing import Any
from xml.etree import ElementTree

import pytest
from geometry_msgs.msg import Transform
from hypothesis import given
from hypothesis import strategies as st
from rclpy.node import Node
from std_msgs.msg import Float64

from interfaces import robot_model
from interfaces.robot_model import (
    BASE,
    EFFECTOR,
    LINK1,
    LINK2,
    forward_kinematics,
    frame_id,
    transforms,
    urdf,
)
from interfaces.service import ServiceNode
from interfaces.service.states import GAP, LATENESS, state
from interfaces.topics import CONFIGURATION, CONTRACT, JOINT_STATES, ROBOT_DESCRIPTION, TF
from reactive_node.signals import Signal
from reactive_node.stamps import from_message, now, stamped
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services.robot_state import Configuration, configurations, lengths, wire

NS = 10**9
link_lengths = st.floats(0, 1e3)
angles = st.floats(-1e3, 1e3)


def test_configuration_is_that_of_common_times(scheduler: VirtualTime) -> None:
    """However late the messages of the four sources are."""

    def source(first: float, slope: float, late: float) -> Signal[float]:
        times = [first + 0.04 * k for k in range(50)]
        samples = scheduler.hot(*((t + late, stamped(slope * t, round(t * NS))) for t in times))
        return state(samples, scheduler.hot((0.0, stamped(True, 0))))

    states = [
        source(0.004, 1.0, 0.001),
        source(0.010, 2.0, 0.049),
        source(0.02, 3.0, 0.0),
        source(0.03, -1.0, 0.03),
    ]

    found = [it for _, it in scheduler.record(configurations(states, rate=20.0), until=1.0).items]

    assert [it.time for it in found] == [k * NS // 20 for k in range(1, len(found) + 1)]
    assert len(found) >= 17
    for time, value, _ in found:
        seconds = time / NS
        assert value == pytest.approx((seconds, 2 * seconds, 3 * seconds, -seconds), abs=1e-9)


@pytest.mark.parametrize("lives", [True, False])
def test_resting_configuration_is_repeated_at_the_rate(scheduler: VirtualTime, lives: bool) -> None:
    """Even after the death of a source: its last value is shown."""
    alive = [(0.0, stamped(True, 0)), *([] if lives else [(0.5, stamped(False, NS // 2))])]
    states = [
        state(scheduler.hot((0.01, stamped(value, NS // 100))), scheduler.hot(*alive))
        for value in (2.0, 3.0, 0.1, 0.2)
    ]

    recording = scheduler.record(configurations(states, rate=100.0), until=2.0)

    assert {it.value for _, it in recording.items} == {Configuration(2.0, 3.0, 0.1, 0.2)}
    times = [it.time for _, it in recording.items]
    assert {later - time for time, later in itertools.pairwise(times)} == {NS // 100}
    assert 2.0 - times[-1] / NS < 0.17  # lateness, gap and period


@pytest.mark.parametrize("pause", [0.0, 0.15, 0.5])
def test_stream_is_steady_whenever_the_sources_send(scheduler: VirtualTime, pause: float) -> None:
    """Otherwise, a pause of a busy machine would add to that between two bursts of answers."""

    def source(number: int, period: float) -> Signal[float]:
        times = [0.01 * number + period * k + (pause if period * k > 1.0 else 0) for k in range(50)]
        samples = scheduler.hot(*((t + 0.001, stamped(t, round(t * NS))) for t in times))
        return state(samples, scheduler.hot((0.0, stamped(True, 0))))

    states = [source(number, period) for number, period in enumerate((0.1, 0.1, 0.04, 0.04), 1)]

    found = scheduler.record(configurations(states), until=2.5).items

    assert [at - it.time / NS for at, it in found] == pytest.approx([LATENESS + GAP] * len(found), abs=1e-5)
    assert {later.time - it.time for (_, it), (_, later) in itertools.pairwise(found)} == {NS // 30}


def test_lengths_are_emitted_on_change_at_most_once_a_second(scheduler: VirtualTime) -> None:
    l1 = scheduler.hot(*((0.1 * at, 2.0 + min(at, 25)) for at in range(60)))
    l2 = scheduler.hot(*((0.1 * at, 3.0) for at in range(60)))

    recording = scheduler.record(lengths(l1, l2), until=6.0)

    assert recording.items == [(1, (12.0, 3.0)), (2, (22.0, 3.0)), (3, (27.0, 3.0))]


def _after(pose: tuple[float, float, float], x: float, yaw: float) -> tuple[float, float, float]:
    """Return the pose x, y, heading behind a translation along x and a turn about z."""
    return pose[0] + x * math.cos(pose[2]), pose[1] + x * math.sin(pose[2]), pose[2] + yaw


def _xyz(element: ElementTree.Element | None) -> list[float]:
    assert element is not None
    return [float(number) for number in element.attrib["xyz"].split()]


def _effector_of(description: str, angles: dict[str, float]) -> tuple[float, float]:
    """Return the effector's position by the URDF's joints: parent, child, origin and axis of each."""
    robot = ElementTree.fromstring(description)
    joints = {joint.find("child").attrib["link"]: joint for joint in robot.iter("joint")}  # type: ignore[union-attr]
    chain, link = [], EFFECTOR
    while link in joints:
        chain.append(joints[link])
        link = joints[link].find("parent").attrib["link"]  # type: ignore[union-attr]
    pose = (0.0, 0.0, 0.0)
    for joint in reversed(chain):
        x, *rest = _xyz(joint.find("origin"))
        assert rest == [0.0, 0.0]
        if joint.attrib["type"] == "continuous":
            assert _xyz(joint.find("axis")) == [0.0, 0.0, 1.0]
        pose = _after(pose, x, angles.get(joint.attrib["name"], 0.0))
    return pose[:2]


@given(link_lengths, link_lengths, angles, angles)
def test_urdf_has_the_kinematics_of_the_arm(l1: float, l2: float, theta1: float, theta2: float) -> None:
    position = _effector_of(urdf(l1, l2), {"theta1": theta1, "theta2": theta2})
    assert position == pytest.approx(forward_kinematics(l1, l2, theta1, theta2), rel=1e-9, abs=1e-6)


@given(link_lengths, link_lengths, angles, angles)
def test_transforms_have_the_kinematics_of_the_arm(
    l1: float, l2: float, theta1: float, theta2: float
) -> None:
    pose, frame = (0.0, 0.0, 0.0), BASE
    for parent, child, transform in transforms(l1, l2, theta1, theta2):
        assert parent == frame
        pose, frame = _after(pose, transform.translation.x, _yaw(transform)), child
    assert frame == EFFECTOR
    assert pose[:2] == pytest.approx(forward_kinematics(l1, l2, theta1, theta2), rel=1e-9, abs=1e-6)


def _yaw(transform: Transform) -> float:
    turn = transform.rotation
    assert (turn.x, turn.y, transform.translation.y, transform.translation.z) == (0, 0, 0, 0)
    assert math.hypot(turn.z, turn.w) == pytest.approx(1.0)
    return 2 * math.atan2(turn.z, turn.w)


def test_pictured_links_reach_from_joint_to_joint() -> None:
    robot = ElementTree.fromstring(urdf(2.5, 0.75))
    pictured = {}
    for link in robot.iter("link"):
        if (box := link.find("visual/geometry/box")) is not None:
            pictured[link.attrib["name"]] = box.attrib["size"].split()[0], _xyz(link.find("visual/origin"))[0]
    assert pictured == {LINK1: ("2.5", 1.25), LINK2: ("0.75", 0.375)}


def test_pictured_links_stand_out_from_the_background_of_rviz() -> None:
    background = 48 / 255  # RViz's default, in each channel
    colors = [color.attrib["rgba"] for color in ElementTree.fromstring(urdf(2.0, 3.0)).iter("color")]
    assert len(colors) == 4
    for color in colors:
        assert max(abs(float(channel) - background) for channel in color.split()[:3]) > 0.3


@pytest.mark.parametrize(
    ("namespace", "prefix"), [("/", ""), ("/arm1", "arm1/"), ("/site/arm1", "site/arm1/")]
)
def test_frames_of_a_namespace_carry_its_name(namespace: str, prefix: str) -> None:
    frames = [f"{prefix}{frame}" for frame in (BASE, LINK1, LINK2, EFFECTOR)]
    assert [frame_id(frame, namespace) for frame in (BASE, LINK1, LINK2, EFFECTOR)] == frames
    robot = ElementTree.fromstring(urdf(2.0, 3.0, namespace))
    assert [link.attrib["name"] for link in robot.iter("link")] == frames
    assert {link.attrib["link"] for link in robot.iter() if "link" in link.attrib} == set(frames)


VIEWED = [topic for topic in CONTRACT if topic in (JOINT_STATES, TF)]
"""What tools read all the time: without tf2_msgs, there is no `/tf`."""


def test_node_in_a_namespace_describes_its_arm(make_node: MakeNode, spin_until: SpinUntil) -> None:
    wire(make_node("robot_state", kind=ServiceNode, namespace="/arm1"))
    peer = make_node("peer", kind=Node, namespace="/arm1")
    last: dict[str, Any] = {}
    for topic in (*VIEWED, ROBOT_DESCRIPTION):
        name = topic.name
        keep: Callable[[Any], None] = lambda message, name=name: last.update({name: message})  # noqa: E731
        peer.create_subscription(topic.type, name, keep, topic.qos)
    values = {"l1": 2.0, "l2": 3.0, "theta1": 0.5, "theta2": -0.25}
    publishers = {
        name: peer.create_publisher(topic.type, name, topic.qos) for name, topic in CONFIGURATION.items()
    }
    before = now()
    for name, publisher in publishers.items():
        publisher.publish(Float64(data=values[name]))

    spin_until(lambda: len(last) == len(VIEWED) + 1)
    state = last[JOINT_STATES.name]
    assert before - timedelta(seconds=2 * LATENESS) <= from_message(state.header.stamp) <= now()
    assert dict(zip(state.name, state.position, strict=True)) == {"theta1": 0.5, "theta2": -0.25}
    assert last[ROBOT_DESCRIPTION.name].data == urdf(2.0, 3.0, "/arm1")

    publishers["l1"].publish(Float64(data=4.0))
    spin_until(lambda: last[ROBOT_DESCRIPTION.name].data == urdf(4.0, 3.0, "/arm1"))
    if TF in VIEWED:
        spin_until(lambda: last[TF.name].transforms[1].transform.translation.x == 4.0)
        sent = last[TF.name].transforms
        assert [(it.header.frame_id, it.child_frame_id) for it in sent] == [
            ("arm1/base", "arm1/link1"),
            ("arm1/link1", "arm1/link2"),
            ("arm1/link2", "arm1/effector"),
        ]
        assert len({(it.header.stamp.sec, it.header.stamp.nanosec) for it in sent}) == 1


def test_angles_are_read_only_while_somebody_looks(make_node: MakeNode, spin_until: SpinUntil) -> None:
    node, peer = make_node("robot_state", kind=ServiceNode), make_node("peer", kind=Node)
    wire(node)

    def read() -> set[str]:
        return {each.topic_name for each in node.subscriptions}

    spin_until(lambda: peer.count_publishers(JOINT_STATES.name) == 1)
    assert {"/l1", "/l2"} <= read()
    assert not {"/theta1", "/theta2"} & read()
    for topic in VIEWED:
        viewer = peer.create_subscription(topic.type, topic.name, lambda _: None, topic.qos)
        spin_until(lambda: {"/theta1", "/theta2"} <= read())
        peer.destroy_subscription(viewer)
        spin_until(lambda: not {"/theta1", "/theta2"} & read())


def test_joints_are_named_after_the_topics_of_their_angles() -> None:
    moving = re.findall(r'<joint name="(\w+)" type="continuous">', urdf(2.0, 3.0))
    assert moving == list(robot_model.JOINTS) == ["theta1", "theta2"]


WITHOUT_TF2_MSGS = """
import sys

sys.modules["tf2_msgs"] = None  # as if it were not installed
import rclpy
from interfaces import topics
from interfaces.service import ServiceNode
from interfaces.service.states import state
from services import robot_state

rclpy.init()
node = ServiceNode("robot_state")
robot_state.wire(node)
published = {one.topic_name.lstrip("/") for one in node.publishers}
print(topics.TF in topics.CONTRACT, *sorted(published & {"joint_states", "robot_description", "tf"}))
node.destroy_node()
rclpy.shutdown()
"""


def test_without_tf2_msgs_the_arm_publishes_all_but_transforms(domain_id: int) -> None:
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT_TF2_MSGS], capture_output=True, text=True, timeout=150
    )
    assert (run.stdout, run.stderr) == ("False joint_states robot_description\n", "")
