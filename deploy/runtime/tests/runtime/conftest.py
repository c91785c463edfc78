"""What tests of the embedded runtime may rely on besides."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rclpy._dds import Participant


@pytest.fixture
def participant(domain_id: int) -> Iterator[Participant]:
    """A member of the test's domain that is no node's, and writes what it wants."""
    participant = Participant(domain_id, "enclave=/;")
    yield participant
    participant.close()
