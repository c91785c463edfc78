"""What a participant knows of the endpoints of others."""

from __future__ import annotations

import pytest
from rclpy.qos import QoSProfile

from rclpy_ground.cyclonedds.discovery import Discovery
from rclpy_ground.cyclonedds.entities import Participant, WaitSet

LIMIT = 20_000_000_000  # ns


@pytest.fixture
def discovery(participant: Participant) -> Discovery:
    return Discovery(participant.handle)


def wait_for(conditions: list[int]) -> None:
    waiting = WaitSet()
    for condition in conditions:
        waiting.attach(condition, 0)
    assert waiting.wait(LIMIT)
    waiting.close()


def test_writer_that_was_taken_for_gone_is_listed_no_more(
    participant: Participant, discovery: Discovery
) -> None:
    writer = participant.create_writer("rt/topic", "Type", QoSProfile(depth=1), "")
    assert [each.gid for each in discovery.writers()] == [writer.gid]
    writer.close()
    wait_for(discovery.gone)
    discovery.forget_gone()  # nothing is new any more
    assert discovery.writers() == []


def test_same_list_is_returned_while_nothing_changes(participant: Participant, discovery: Discovery) -> None:
    writers, readers = discovery.writers(), discovery.readers()
    participant.create_writer("rt/topic", "Type", QoSProfile(depth=1), "")
    assert discovery.writers() is not writers
    assert discovery.readers() is readers
