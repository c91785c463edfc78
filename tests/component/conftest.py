from __future__ import annotations

from functools import partial

import pytest
from rclpy.node import Node

from interfaces.service import ServiceNode
from reactive_node.testing import MakeNode, SpinUntil
from tests.component.wiring import Connect, Wired


@pytest.fixture
def connect(make_node: MakeNode, spin_until: SpinUntil) -> Connect:
    return partial(Wired, make_node, spin_until)


@pytest.fixture
def peer(make_node: MakeNode) -> Node:
    node: Node = make_node("peer", kind=Node)
    return node


@pytest.fixture
def service(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> ServiceNode:
    """A service that reports its health only when a test asks for it."""
    monkeypatch.setattr("interfaces.service.health.PERIOD", 3600.0)
    node: ServiceNode = make_node("service", kind=ServiceNode)
    return node
