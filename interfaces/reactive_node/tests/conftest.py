"""A reactive node and a peer."""

from __future__ import annotations

import pytest
from rclpy.node import Node

from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode


@pytest.fixture
def node(make_node: MakeNode) -> ReactiveNode:
    node: ReactiveNode = make_node("reactive")
    return node


@pytest.fixture
def peer(make_node: MakeNode) -> Node:
    """An ordinary node in the same domain."""
    peer: Node = make_node("peer", kind=Node)
    return peer
