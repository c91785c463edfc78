"""Calls the parameter services of another node. The node that asks must not be spinning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import rclpy
from rclpy import parameter
from ros2cli.parameters import client_of, type_name

if TYPE_CHECKING:
    from rcl_interfaces.msg import Parameter, ParameterValue
    from rclpy.node import Node
    from rclpy.parameter_client import AsyncParameterClient
    from rclpy.task import Future


def get_value(*, parameter_value: ParameterValue) -> Any:
    """Return the value of a message as a value of Python."""
    return parameter.parameter_value_to_python(parameter_value)


def get_parameter_type_string(parameter_type: int) -> str:
    """Return the name of a type, a constant of ``rcl_interfaces/msg/ParameterType``."""
    return type_name(parameter_type)


def call_describe_parameters(*, node: Node, node_name: str, parameter_names: list[str] | None = None) -> Any:
    """Return the response with the descriptors of parameters. Raises RuntimeError if there is none."""
    return _response(node, _client(node, node_name).describe_parameters(parameter_names or []))


def call_get_parameters(*, node: Node, node_name: str, parameter_names: list[str]) -> Any:
    """Return the response with the values of parameters. Raises RuntimeError if there is none."""
    return _response(node, _client(node, node_name).get_parameters(parameter_names))


def call_set_parameters(*, node: Node, node_name: str, parameters: list[Parameter]) -> Any:
    """Set parameters; return the response with the results. Raises RuntimeError if there is none."""
    return _response(node, _client(node, node_name).set_parameters(parameters))


def call_list_parameters(*, node: Node, node_name: str, prefixes: list[str] | None = None) -> Future | None:
    """Return the completed future of a response with the names; ``None`` without parameter services."""
    client = client_of(node, node_name)
    if client is None:
        return None
    future = client.list_parameters(prefixes)
    rclpy.spin_until_future_complete(node, future)
    return future


def _client(node: Node, node_name: str) -> AsyncParameterClient:
    client = client_of(node, node_name)
    if client is None:
        raise RuntimeError(f"Wait for service timed out waiting for parameter services for node {node_name}")
    return client


def _response(node: Node, future: Future) -> Any:
    rclpy.spin_until_future_complete(node, future)
    if future.result() is None:
        raise RuntimeError("The parameter service has not answered")
    return future.result()
