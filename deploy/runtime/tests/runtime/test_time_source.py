"""Simulated time and ``wait_for_message``: rejected changes, detached nodes, contexts that end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.wait_for_message import wait_for_message
from std_msgs.msg import String


def set_use_sim_time(node: Node, value: bool) -> SetParametersResult:
    return node.set_parameters([Parameter("use_sim_time", value=value)])[0]


def test_a_rejected_change_keeps_system_time(make_node: Callable[..., Node]) -> None:
    node = make_node()

    def reject(parameters: list[Parameter]) -> SetParametersResult:
        return SetParametersResult(successful=False, reason="not now")

    # Appended: the time source is asked before this callback.
    node._on_set_parameters_callbacks.append(reject)
    assert set_use_sim_time(node, True).reason == "not now"
    assert not node.get_clock().ros_time_is_active  # type: ignore[attr-defined]


def test_a_detached_time_source_no_longer_follows_its_node(make_node: Callable[..., Node]) -> None:
    node = make_node()
    source = node._time_source
    set_use_sim_time(node, True)
    source.detach_node()
    assert list(node.subscriptions) == []
    set_use_sim_time(node, False)
    assert source.ros_time_is_active


def test_wait_for_message_ends_with_its_context(make_node: Callable[..., Node], context: Context) -> None:
    node = make_node()
    result: list[tuple[bool, Any]] = []
    thread = threading.Thread(target=lambda: result.append(wait_for_message(String, node, "silence")))
    thread.start()
    while thread.is_alive() and not list(node.subscriptions):
        thread.join(0.001)
    context.shutdown()
    thread.join(10)
    assert result == [(False, None)]


def test_wait_for_message_ends_if_the_context_ends_before_the_wait(
    make_node: Callable[..., Node], context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    create_subscription = node.create_subscription

    def create_and_shut_down(*args: Any, **options: Any) -> Any:
        subscription = create_subscription(*args, **options)
        context.shutdown()
        return subscription

    monkeypatch.setattr(node, "create_subscription", create_and_shut_down)
    assert wait_for_message(String, node, "silence") == (False, None)
