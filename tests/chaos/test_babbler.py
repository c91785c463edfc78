from __future__ import annotations

import random
import time
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PointStamped
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from interfaces import topics
from interfaces.robot_model import forward_kinematics
from services import engine_controller
from tests.chaos import babbler
from tests.chaos.babbler import nonsense
from tests.promises.marks import TEXT, is_babble, nan


@pytest.mark.parametrize("topic", topics.CONTRACT, ids=lambda topic: topic.name)
def test_babble_is_bad_and_marked(topic: topics.Topic) -> None:
    rng = random.Random(1)
    for _ in range(200):
        data = nonsense(topic, rng)
        assert is_babble(topic, data) or topic is topics.OPERATOR_HEARTBEAT
        try:
            read = deserialize_message(data, topic.type)
        except Exception:  # unreadable, as intended
            continue
        accepts_everything = topic.problem is topics.Topic.problem
        assert topic.problem(topic.value(read)) or accepts_everything


def test_messages_of_services_are_not_babble() -> None:
    for topic in topics.CONTRACT:
        assert not is_babble(topic, serialize_message(topic.type()))


def test_pretended_presence_is_marked_and_too_old_for_turn_on(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[Header] = []
    publisher = SimpleNamespace(publish=sent.append)
    node: Any = SimpleNamespace(create_publisher=lambda *_: publisher)
    monkeypatch.setattr(babbler, "_ticks", lambda rate: [None])
    monkeypatch.setattr(time, "time_ns", lambda: 12_500_000_000)
    babbler.pretend(node, 2.0)
    (presence,) = sent
    assert (presence.stamp.sec, presence.stamp.nanosec) == (11, 300_000_000)
    assert engine_controller.DEFAULTS.max_presence_age < babbler.PRETENDED_AGE < 1.36
    assert is_babble(topics.OPERATOR_PRESENCE, serialize_message(presence))


def test_position_computed_from_babble_is_not_babble() -> None:
    x, y = forward_kinematics(nan(topics.L1), 3.0, 0.5, 0.5)
    position = PointStamped(point=Point(x=x, y=y))
    assert not is_babble(topics.EFFECTOR_POSITION, serialize_message(position))


def test_health_that_quotes_babble_is_not_babble() -> None:
    report = DiagnosticStatus(name="/kinematics", message=f"engines: '{TEXT}' is unknown")
    assert not is_babble(topics.DIAGNOSTICS, serialize_message(DiagnosticArray(status=[report])))
