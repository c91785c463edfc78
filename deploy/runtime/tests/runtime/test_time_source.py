"""Simulated time: what others reject, and what ends with its node or context."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from deploy.runtime.tests.conformance.test_time_source import clock_topics, use_sim_time

from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.wait_for_message import wait_for_message
from std_msgs.msg import String


def test_what_another_callback_rejects_does_not_happen(make_node: Callable[..., Node]) -> None:
    node = make_node()

    def reject(parameters: list[Parameter]) -> SetParametersResult:
        return SetParametersResult(successful=False, reason="not now")

    # The time source was there first, so it is asked last: ask it first.
    node._on_set_parameters_callbacks.append(reject)
    assert use_sim_time(node, True).reason == "not now"
    assert not node.get_clock().ros_time_is_active  # type: ignore[attr-defined]


def test_a_source_detached_from_its_node_follows_it_no_longer(make_node: Callable[..., Node]) -> None:
    node = make_node()
    source = node._time_source
    use_sim_time(node, True)
    source.detach_node()
    assert clock_topics(node) == []
    use_sim_time(node, False)
    assert source.ros_time_is_active


def test_waiting_ends_with_the_context(make_node: Callable[..., Node], context: Context) -> None:
    node = make_node()
    result: list[tuple[bool, Any]] = []
    thread = threading.Thread(target=lambda: result.append(wait_for_message(String, node, "silence")))
    thread.start()
    while thread.is_alive() and not list(node.subscriptions):
        thread.join(0.001)
    context.shutdown()
    thread.join(10)
    assert result == [(False, None)]


def test_waiting_ends_with_a_context_that_ends_before_it_has_begun(
    make_node: Callable[..., Node], context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    create_subscription = node.create_subscription

    def create_untimely(*args: Any, **options: Any) -> Any:
        subscription = create_subscription(*args, **options)
        context.shutdown()
        return subscription

    monkeypatch.setattr(node, "create_subscription", create_untimely)
    assert wait_for_message(String, node, "silence") == (False, None)
