"""A reactive node and a peer, on each executor that services may have."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node

from interfaces.reactive_node.tests.simulated import Simulation
from reactive_node import ReactiveNode
from reactive_node.executor import create_executor

if TYPE_CHECKING:  # the conftest of the repository imports this plugin later
    from reactive_node.testing import MakeNode, SpinUntil

EXECUTORS = [lambda context: SingleThreadedExecutor(context=context)]
if importlib.util.find_spec("rclpy.experimental"):
    EXECUTORS.append(create_executor)


@pytest.fixture(params=EXECUTORS, ids=["default", "events"][: len(EXECUTORS)])
def executor(request: pytest.FixtureRequest, context: Context) -> Iterator[Executor]:
    with request.param(context) as executor:
        yield executor


@pytest.fixture
def simulation(make_node: MakeNode, spin_until: SpinUntil) -> Simulation:
    return Simulation(make_node, spin_until)


@pytest.fixture
def node(make_node: MakeNode) -> ReactiveNode:
    node: ReactiveNode = make_node("reactive")
    return node


@pytest.fixture
def peer(make_node: MakeNode) -> Node:
    peer: Node = make_node("peer", kind=Node)
    return peer
