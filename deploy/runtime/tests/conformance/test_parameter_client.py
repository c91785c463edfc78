"""The parameter event handler: which callbacks run, in which order, and until when."""

from __future__ import annotations

import pytest
from deploy.runtime.tests.nodes import SpinUntil

from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter_event_handler import ParameterEventHandler


@pytest.fixture
def handler(node: Node, spin_until: SpinUntil) -> ParameterEventHandler:
    handler = ParameterEventHandler(node)
    spin_until(handler.parameter_event_subscription.get_publisher_count)
    return handler


def test_a_node_in_the_root_namespace_resolves_node_names_there(
    handler: ParameterEventHandler, node: Node, spin_until: SpinUntil
) -> None:
    values: list[ParameterMsg] = []
    handler.add_parameter_callback("a", "node", values.append)
    node.declare_parameter("a", 1)
    spin_until(lambda: values)
    assert values[0].value.integer_value == 1


def test_newest_callbacks_run_first_and_event_callbacks_run_last(
    handler: ParameterEventHandler, node: Node, spin_until: SpinUntil
) -> None:
    calls: list[str] = []
    handler.add_parameter_event_callback(lambda event: calls.append("event 1"))
    handler.add_parameter_event_callback(lambda event: calls.append("event 2"))
    handler.add_parameter_callback("a", "", lambda message: calls.append("parameter 1"))
    handler.add_parameter_callback("a", "", lambda message: calls.append("parameter 2"))
    node.declare_parameter("a", 1)
    spin_until(lambda: len(calls) == 4)
    assert calls == ["parameter 2", "parameter 1", "event 2", "event 1"]


def test_a_removed_callback_is_not_called_and_cannot_be_removed_again(
    handler: ParameterEventHandler, node: Node, spin_until: SpinUntil
) -> None:
    calls: list[object] = []
    heard: list[ParameterEvent] = []
    parameter_handle = handler.add_parameter_callback("a", "", calls.append)
    event_handle = handler.add_parameter_event_callback(calls.append)
    handler.remove_parameter_callback(parameter_handle)
    handler.remove_parameter_event_callback(event_handle)
    handler.add_parameter_event_callback(heard.append)
    node.declare_parameter("a", 1)
    spin_until(lambda: heard)
    assert calls == []
    with pytest.raises(RuntimeError, match="doesn't exist"):
        handler.remove_parameter_callback(parameter_handle)
    with pytest.raises(RuntimeError, match="doesn't exist"):
        handler.remove_parameter_event_callback(event_handle)


def test_all_new_values_of_an_event_can_be_read() -> None:
    new, changed = ParameterMsg(name="a"), ParameterMsg(name="b")
    event = ParameterEvent(node="/ns/other", new_parameters=[new], changed_parameters=[changed])
    assert list(ParameterEventHandler.get_parameters_from_event(event)) == [new, changed]
    assert ParameterEventHandler.get_parameter_from_event(event, "b", "/ns/other") == changed
    assert ParameterEventHandler.get_parameter_from_event(event, "c", "/ns/other") is None
    assert ParameterEventHandler.get_parameter_from_event(event, "b", "/ns/me") is None


def test_destroying_a_handler_destroys_its_subscription(handler: ParameterEventHandler, node: Node) -> None:
    assert handler.parameter_event_subscription in list(node.subscriptions)
    handler.destroy()
    assert handler.parameter_event_subscription not in list(node.subscriptions)
