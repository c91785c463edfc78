"""Failed creations leave nothing behind, and destroyed nodes create nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rclpy.exceptions import InvalidHandle, RCLError
from rclpy.node import Node
from std_srvs.srv import Trigger


@pytest.mark.parametrize(
    ("create", "topic"),
    [
        (lambda node: node.create_service(Trigger, "x", print), "rr/xReply"),
        (lambda node: node.create_client(Trigger, "x"), "rq/xRequest"),
    ],
)
def test_a_failed_service_or_client_leaves_no_endpoint(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch, create: Callable[[Node], Any], topic: str
) -> None:
    def fail(*args: Any) -> None:
        raise RCLError("planted")

    node = make_node()
    with monkeypatch.context() as patch:
        patch.setattr(node._rclpy_graph, "create_reader", fail)
        with pytest.raises(RCLError, match="planted"):
            create(node)
    assert node.get_publishers_info_by_topic(topic, no_mangle=True) == []
    create(node)
    assert len(node.get_publishers_info_by_topic(topic, no_mangle=True)) == 1


@pytest.mark.parametrize(
    "create", [lambda node: node.create_timer(1.0, print), lambda node: node.create_guard_condition(print)]
)
def test_a_destroyed_node_creates_no_timer_and_no_guard_condition(
    make_node: MakeNode, create: Callable[[Node], Any]
) -> None:
    node = make_node()
    node.destroy_node()
    with pytest.raises(InvalidHandle, match="destroyed"):
        create(node)
