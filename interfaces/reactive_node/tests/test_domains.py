from __future__ import annotations

import socket

import pytest

from reactive_node import domains
from reactive_node.domains import reserved_domain


def test_domain_is_reserved_once_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    with reserved_domain() as first:
        monkeypatch.setattr(domains, "DOMAINS", range(first, first + 1))
        with pytest.raises(RuntimeError, match="no free ROS domain"), reserved_domain():
            pass


@pytest.mark.parametrize("offset", [0, 10, 35, 249])
def test_domain_with_participants_is_not_free(offset: int) -> None:
    with reserved_domain() as free, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        assert not domains.has_participants(free)
        participant.bind(("127.0.0.1", 7400 + 250 * free + offset))
        assert domains.has_participants(free)


def test_error_inside_reservation_is_raised() -> None:
    with pytest.raises(OSError, match="planted"), reserved_domain():
        raise OSError("planted")
