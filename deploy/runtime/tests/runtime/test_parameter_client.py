from __future__ import annotations

from deploy.runtime.tests.nodes import SpinUntil

from rcl_interfaces.msg import Parameter as ParameterMsg
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_event_handler import ParameterEventHandler


def test_a_callback_may_remove_itself(spin_until: SpinUntil, node: Node) -> None:
    handler = ParameterEventHandler(node)
    called: list[str] = []
    heard: list[object] = []

    def once(message: ParameterMsg) -> None:
        called.append(message.name)
        handler.remove_parameter_callback(handle)

    handle = handler.add_parameter_callback("a", "", once)
    handler.add_parameter_event_callback(heard.append)
    node.declare_parameter("a", 1)
    node.set_parameters([Parameter("a", value=2)])
    spin_until(lambda: len(heard) == 2)
    assert called == ["a"]
