from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from geometry_msgs.msg import Point, PointStamped, Twist, TwistStamped, Vector3
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState, TimeReference
from std_msgs.msg import Bool, Float64, Header, String

from interfaces import topics
from interfaces.topics import PlanarTwist, Position, Sender, Topic

BEYOND = "{} is not from -1e+09 to 1e+09"


@pytest.mark.parametrize(
    ("topic", "value", "problem"),
    [
        (topics.L1, 0.0, ""),
        (topics.L1, -0.5, "-0.5 is negative"),
        (topics.L2, math.inf, "inf is not finite"),
        (topics.L2, -0.5, "-0.5 is negative"),
        (topics.THETA1, -0.5, ""),
        (topics.THETA1, math.nan, "nan is not finite"),
        (topics.THETA2, -math.inf, "-inf is not finite"),
        (topics.EFFECTOR_SPEED, -0.5, "-0.5 is negative"),
        (topics.EFFECTOR_POSITION, Position(0, 1.0, -1.0), ""),
        (topics.EFFECTOR_POSITION, Position(0, math.nan, 1.0), "(nan, 1.0) is not finite"),
        (topics.EFFECTOR_POSITION, Position(0, 1.0, math.inf), "(1.0, inf) is not finite"),
        (topics.DRIVEN_TIME, topics.DrivenTime(0, 1e9, "", ""), ""),
        (topics.DRIVEN_TIME, topics.DrivenTime(0, 1e300, "", ""), BEYOND.format("1e+300")),
        (topics.THETA1, -1e9, ""),
        (topics.THETA1, -1000000001.0, BEYOND.format("-1000000001.0")),
        (topics.EFFECTOR_POSITION, Position(0, 1e10, 1.0), BEYOND.format("(10000000000.0, 1.0)")),
        (topics.EFFECTOR_TWIST, PlanarTwist(0, 1.0, -2.0, 3.0), ""),
        (topics.EFFECTOR_TWIST, PlanarTwist(0, 1.0, 0.0, math.nan), "(1.0, 0.0, nan) is not finite"),
        (topics.EFFECTOR_TWIST, PlanarTwist(0, 1e308, 1e308, 0.0), BEYOND.format("(1e+308, 1e+308, 0.0)")),
        (topics.OPERATOR_HEARTBEAT, True, ""),
        (topics.OPERATOR_HEARTBEAT, False, "a released switch is no sign of life"),
        *((topics.ENGINES, data, "") for data in ("turn_on", "turn_off")),
        (topics.ENGINES, "x" * 50, f"'{'x' * 40}' is unknown"),
        *((topics.ENGINES_STATE, data, "") for data in ("on", "off")),
        (topics.ENGINES_STATE, "turn_on", "'turn_on' is unknown"),
        *((topics.OPERATOR_ACTIVITY, data, "") for data in ("alive", "missed", "incapacitated")),
        (topics.OPERATOR_ACTIVITY, "asleep", "'asleep' is unknown"),
        (topics.ENGINES_SENDER, Sender("turn_on", "a"), ""),
        (topics.ENGINES_SENDER, Sender("turn_off", 255 * "a"), ""),
        (topics.ENGINES_SENDER, Sender("on", "terminal"), "'on' is unknown"),
        (topics.ENGINES_SENDER, Sender("turn_on", ""), "'' is no name of a node"),
        (topics.ENGINES_SENDER, Sender("turn_on", 256 * "a"), f"'{40 * 'a'}' is no name of a node"),
        (topics.ENGINES_CAUSE, DiagnosticArray(), "it has not one status"),
        (topics.DIAGNOSTICS, DiagnosticArray(), ""),
        (topics.ROBOT_DESCRIPTION, "anything", ""),
    ],
)
def test_problem_of_a_value(topic: Topic, value: Any, problem: str) -> None:
    assert topic.problem(value) == problem


@pytest.mark.parametrize(
    ("topic", "message", "value"),
    [
        (topics.L1, Float64(data=2.5), 2.5),
        (topics.OPERATOR_HEARTBEAT, Bool(data=True), True),
        (topics.ENGINES, String(data="turn_on"), "turn_on"),
        (
            topics.EFFECTOR_POSITION,
            PointStamped(
                header=Header(stamp=Time(sec=7, nanosec=8), frame_id="arm1/base"), point=Point(x=1.0, y=-2.0)
            ),
            Position(7_000_000_008, 1.0, -2.0, "arm1/base"),
        ),
        (
            topics.EFFECTOR_TWIST,
            TwistStamped(
                header=Header(stamp=Time(sec=7, nanosec=8), frame_id="arm1/base"),
                twist=Twist(linear=Vector3(x=1.0, y=-2.0), angular=Vector3(z=3.0)),
            ),
            PlanarTwist(7_000_000_008, 1.0, -2.0, 3.0, "arm1/base"),
        ),
        (
            topics.OPERATOR_PRESENCE,
            Header(stamp=Time(sec=1, nanosec=5000)),
            datetime(1970, 1, 1, 0, 0, 1, 5, tzinfo=UTC),
        ),
        (
            topics.DRIVEN_TIME,
            TimeReference(
                header=Header(stamp=Time(sec=7, nanosec=8), frame_id="robot"),
                time_ref=Time(sec=5, nanosec=500_000_000),
                source="id",
            ),
            topics.DrivenTime(7_000_000_008, 5.5, "id", "robot"),
        ),
        (topics.ENGINES_SENDER, KeyValue(key="turn_on", value="terminal"), Sender("turn_on", "terminal")),
        (topics.OPERATOR_HAND, Header(frame_id="terminal"), Header(frame_id="terminal")),
        (topics.JOINT_STATES, JointState(name=["theta1"]), JointState(name=["theta1"])),
    ],
    ids=lambda it: getattr(it, "name", ""),
)
def test_value_of_a_message_and_back(topic: Topic, message: Any, value: Any) -> None:
    assert topic.value(message) == value
    assert topic.message(value) == message


def test_frame_is_that_of_the_base_if_nobody_names_another() -> None:
    assert Position(0, 1.0, 2.0).frame == PlanarTwist(0, 1.0, 2.0, 3.0).frame == topics.FRAME


def test_clocks_of_two_hosts_may_differ_by_50_ms() -> None:
    assert topics.CLOCK_TOLERANCE == 0.05  # SAFETY.md, A3


def test_topics_that_report_single_events_may_be_silent() -> None:
    gaps = {topic.name: topic.longest_gap for topic in topics.CONTRACT}
    streams = ("l1", "theta2", "effector/position", "effector/speed", "joint_states", "engines/state")
    assert gaps == gaps | {
        **dict.fromkeys(("effector/twist", "robot_description", "operator_activity", "engines"), math.inf),
        **dict.fromkeys(("operator_hand", "engines/sender", "engines/cause"), math.inf),
        **dict.fromkeys(("operator_presence", "/diagnostics"), 1.0),  # at 2 Hz, at 1 Hz
        **dict.fromkeys((*streams, "operator_heartbeat"), 0.25),
    }


def test_topics_follow_those_that_they_are_made_of() -> None:
    assert {topic.name: topic.follows for topic in topics.CONTRACT} == {
        **{topic.name: "" for topic in topics.CONTRACT},
        "theta1": "driven_time",
        "theta2": "driven_time",
        "effector/speed": "effector/position",
        "operator_hand": "operator_heartbeat",
        "operator_presence": "operator_heartbeat",
    }


def test_transforms_are_a_topic_even_where_their_type_is_missing() -> None:
    tf = topics.TF
    assert (tf.name, tf.qos.depth, tf.unit, tf.publishers) == ("/tf", 100, "m, rad", ("robot_state",))
    assert tf.meaning.endswith("only where the package tf2_msgs is installed")


def test_configuration_is_the_four_sources_and_a_drive_moves_the_angles() -> None:
    assert topics.JOINTS == (topics.THETA1, topics.THETA2)
    assert list(topics.CONFIGURATION.items()) == [
        (topic.name, topic) for topic in (topics.L1, topics.L2, topics.THETA1, topics.THETA2)
    ]


@pytest.mark.parametrize(
    ("topic", "qos"),
    [
        # A heartbeat that waits, or is sent again, is no sign of life: only the newest counts.
        (topics.OPERATOR_HEARTBEAT, "best effort, volatile, last 1"),
        (topics.OPERATOR_PRESENCE, "reliable, volatile, last 1"),
        # A command must not get lost, and none may come again to a controller that restarts.
        (topics.ENGINES, "reliable, volatile, last 10"),
        # A drive that restarts knows at once that another controller has said `off`; an old `on` expires.
        (topics.ENGINES_STATE, "reliable, transient local, last 1, lifespan 400 ms"),
        (topics.DRIVEN_TIME, "reliable, volatile, last 1, lifespan 400 ms"),
    ],
)
def test_qos_in_the_path_of_safety(topic: Topic, qos: str) -> None:
    assert f"| `{topic.name}` | {topic.type_name.replace('/msg', '')} | {qos} |" in topics.markdown()


def test_lifespan_is_reported_if_there_is_one() -> None:
    assert topics.describe(topics.DRIVEN_TIME.qos).endswith("last 1, lifespan 400 ms")
    assert topics.describe(QoSProfile(depth=3)) == "reliable, volatile, last 3"


@pytest.mark.parametrize(
    ("topic", "namespace", "name"),
    [
        (topics.L1, "/", "/l1"),
        (topics.L1, "/arm1", "/arm1/l1"),
        (topics.L1, "/armX", "/armX/l1"),
        (topics.DIAGNOSTICS, "/arm1", "/diagnostics"),
    ],
)
def test_full_name_is_in_the_namespace_of_the_arm(topic: topics.Topic, namespace: str, name: str) -> None:
    assert topic.full_name(namespace) == name
