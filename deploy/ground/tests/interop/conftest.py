from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from itertools import count

import pytest
from deploy.ground.tests.interop.processes import PeerProcess

StartPeer = Callable[..., PeerProcess]
PeerOn = Callable[[str], PeerProcess]
NUMBERS = count()


@pytest.fixture(scope="module")
def start_peer(module_domain_id: int) -> Iterator[StartPeer]:
    """Starts processes in a domain of the module, with more variables; they end after the module."""
    domain = {"ROS_DOMAIN_ID": str(module_domain_id)}
    with ExitStack() as stack:
        yield lambda rclpy, name="", **more: stack.enter_context(PeerProcess(rclpy, domain | more, name))


@pytest.fixture(scope="module")
def peer_on(start_peer: StartPeer) -> PeerOn:
    """One process of the module for each rclpy, started on first use."""
    return cache(start_peer)


@pytest.fixture
def topic() -> str:
    return f"/interop/topic_{next(NUMBERS)}"
