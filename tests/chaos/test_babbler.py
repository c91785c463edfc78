"""What the babbler says: nothing that a reader may take for good, and all of it known as babble."""

from __future__ import annotations

import random

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PointStamped
from rclpy.serialization import deserialize_message, serialize_message

from deploy.chaos.babbler import nonsense
from deploy.chaos.marks import TEXT, is_babble, nan
from interfaces import topics
from services.kinematics import forward_kinematics


@pytest.mark.parametrize(
    "topic", [t for t in topics.CONTRACT if t is not topics.DIAGNOSTICS], ids=lambda t: t.name
)
def test_nothing_that_the_babbler_says_is_good_and_all_is_marked(topic: topics.Topic) -> None:
    rng = random.Random(1)
    for _ in range(200):
        message = nonsense(topic, rng)
        data = message if isinstance(message, bytes) else serialize_message(message)
        assert is_babble(topic, data) or topic is topics.OPERATOR_HEARTBEAT
        try:
            read = deserialize_message(data, topic.type)
        except Exception:  # unreadable, as it should be
            continue
        assert topic.problem(read) or topic is topics.OPERATOR_PRESENCE


def test_what_services_say_is_not_taken_for_babble() -> None:
    for topic in topics.CONTRACT:
        assert not is_babble(topic, serialize_message(topic.type()))


def test_a_position_that_comes_of_babble_is_not_taken_for_babble() -> None:
    x, y = forward_kinematics(nan(topics.L1), 3.0, 0.5, 0.5)
    position = PointStamped(point=Point(x=x, y=y))
    assert not is_babble(topics.EFFECTOR_POSITION, serialize_message(position))


def test_a_service_that_complains_of_babble_is_not_taken_for_the_babbler() -> None:
    complaint = DiagnosticStatus(name="/kinematics", message=f"engines: '{TEXT}' is unknown")
    assert not is_babble(topics.DIAGNOSTICS, serialize_message(DiagnosticArray(status=[complaint])))
