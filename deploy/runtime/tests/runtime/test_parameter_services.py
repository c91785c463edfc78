"""The parameter and logger services: all values or none, their queues, and what rclpy cannot refuse."""

from __future__ import annotations

import pytest
from deploy.runtime.tests.nodes import Call, MakeNode

import rclpy.logging
from rcl_interfaces.msg import LoggerLevel, ParameterType, ParameterValue
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.srv import (
    DescribeParameters,
    GetLoggerLevels,
    GetParameters,
    GetParameterTypes,
    SetLoggerLevels,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter


@pytest.fixture
def node(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    node = make_node(enable_logger_service=True)
    executor.add_node(node)
    node.declare_parameter("value", 1.5)
    node.declare_parameter("unset", Parameter.Type.INTEGER)
    return node


def test_the_parameter_services_queue_a_thousand_requests(node: Node) -> None:
    depths = {service.srv_name: service.qos_profile.depth for service in node.services}
    assert [depth for name, depth in depths.items() if "parameter" in name] == [1000] * 6


@pytest.mark.parametrize("other", ["missing", "unset"])
def test_values_types_and_descriptors_are_returned_all_or_none(call: Call, other: str) -> None:
    (value,) = call(GetParameters, "node/get_parameters", names=["value"]).values
    assert value.double_value == 1.5
    assert call(GetParameters, "node/get_parameters", names=["value", other]).values == []
    types = list(call(GetParameterTypes, "node/get_parameter_types", names=["value", other]).types)
    assert types == ([3, ParameterType.PARAMETER_NOT_SET] if other == "unset" else [])
    described = call(DescribeParameters, "node/describe_parameters", names=["value", other]).descriptors
    assert [each.name for each in described] == (["value", "unset"] if other == "unset" else [])


def test_an_allowed_undeclared_parameter_is_not_set(
    make_node: MakeNode, executor: SingleThreadedExecutor, call: Call
) -> None:
    executor.add_node(make_node("open", allow_undeclared_parameters=True))
    assert list(call(GetParameterTypes, "open/get_parameter_types", names=["missing"]).types) == [0]
    assert call(GetParameters, "open/get_parameters", names=["missing"]).values == [ParameterValue()]


def test_a_parameter_with_an_unknown_type_is_refused(call: Call) -> None:
    unknown = ParameterMsg(name="value", value=ParameterValue(type=200))
    (result,) = call(SetParameters, "node/set_parameters", parameters=[unknown]).results
    assert not result.successful
    assert "200" in result.reason
    service = "node/set_parameters_atomically"
    assert not call(SetParametersAtomically, service, parameters=[unknown]).result.successful


def test_logger_levels_are_read_and_set(call: Call) -> None:
    levels = [LoggerLevel(name="a", level=40), LoggerLevel(name="b", level=41)]
    results = call(SetLoggerLevels, "node/set_logger_levels", levels=levels).results
    assert [(result.successful, result.reason) for result in results] == [
        (True, ""),
        (False, "Failed reason: Invalid logger level."),
    ]
    got = call(GetLoggerLevels, "node/get_logger_levels", names=["a", "b"]).levels
    assert [(level.name, level.level) for level in got] == [("a", 40), ("b", 0)]
    rclpy.logging.shutdown()
