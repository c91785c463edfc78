from __future__ import annotations

from collections.abc import Iterator

import pytest

from rclpy_ground.cyclonedds.entities import Participant


@pytest.fixture
def participant(domain_id: int) -> Iterator[Participant]:
    """A DDS participant in the test's domain, without a node, that may write arbitrary bytes."""
    participant = Participant(domain_id, "/")
    yield participant
    participant.close()
