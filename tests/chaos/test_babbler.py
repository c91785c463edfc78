"""What the babbler says: nothing that a reader may take for good, and all of it known as babble."""

from __future__ import annotations

import random

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from deploy.chaos.babbler import nonsense
from deploy.chaos.marks import is_babble
from interfaces import topics


@pytest.mark.parametrize(
    "topic", [t for t in topics.CONTRACT if t is not topics.DIAGNOSTICS], ids=lambda t: t.name
)
def test_nothing_that_the_babbler_says_is_good_and_all_is_marked(topic: topics.Topic) -> None:
    rng = random.Random(1)
    for _ in range(200):
        message = nonsense(topic, rng)
        data = message if isinstance(message, bytes) else serialize_message(message)
        assert is_babble(data) or topic is topics.OPERATOR_HEARTBEAT
        try:
            read = deserialize_message(data, topic.type)
        except Exception:  # unreadable, as it should be
            continue
        assert topic.fault(read) or topic is topics.OPERATOR_PRESENCE


def test_what_services_say_is_not_taken_for_babble() -> None:
    for topic in topics.CONTRACT:
        assert not is_babble(serialize_message(topic.type()))
