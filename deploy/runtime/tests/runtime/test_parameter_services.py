"""The responses of the parameter and logger services, called without DDS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import rclpy.logging
from rcl_interfaces.msg import LoggerLevel, ParameterDescriptor, ParameterType, ParameterValue
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
from rclpy._node_parameters import NodeParameters
from rclpy.clock import ROSClock
from rclpy.logging_service import LoggingService
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService
from rclpy.qos import QoSProfile


class Node(NodeParameters):
    """A node with parameters and with services that the test calls by name."""

    def __init__(self, *, allow_undeclared: bool = False) -> None:
        self.services: dict[str, tuple[Any, Callable[[Any, Any], Any], QoSProfile]] = {}
        self._clock = ROSClock()
        self._rclpy_init_parameters({}, allow_undeclared=allow_undeclared)

    def get_name(self) -> str:
        return "node"

    def get_fully_qualified_name(self) -> str:
        return "/node"

    def _rclpy_publish_parameter_event(self, event: object) -> None:
        pass

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[[Any, Any], Any], *, qos_profile: QoSProfile
    ) -> None:
        self.services[srv_name] = (srv_type, callback, qos_profile)

    def call(self, srv_type: Any, name: str, **request: Any) -> Any:
        registered_type, callback, _ = self.services[f"node/{name}"]
        assert registered_type is srv_type
        return callback(srv_type.Request(**request), srv_type.Response())


@pytest.fixture
def node() -> Node:
    node = Node()
    node.declare_parameter("value", 1.5, ParameterDescriptor(description="a length [m]"))
    node.declare_parameter("arm.name", "left")
    node.declare_parameter("unset", Parameter.Type.INTEGER)
    node.parameter_service = ParameterService(node)  # type: ignore[arg-type, attr-defined]
    return node


def test_the_six_services_queue_a_thousand_requests(node: Node) -> None:
    assert sorted(node.services) == [
        "node/describe_parameters",
        "node/get_parameter_types",
        "node/get_parameters",
        "node/list_parameters",
        "node/set_parameters",
        "node/set_parameters_atomically",
    ]
    assert {qos.depth for _, _, qos in node.services.values()} == {1000}


def test_values_are_returned_all_or_none(node: Node) -> None:
    def get(*names: str) -> list[ParameterValue]:
        values: list[ParameterValue] = node.call(GetParameters, "get_parameters", names=list(names)).values
        return values

    assert [value.type for value in get("value", "arm.name")] == [3, 4]
    assert get("value")[0].double_value == 1.5
    assert get("value", "missing") == []
    assert get("value", "unset") == []
    assert get() == []


def test_types_are_returned_all_or_none(node: Node) -> None:
    def types(names: list[str]) -> list[int]:
        return list(node.call(GetParameterTypes, "get_parameter_types", names=names).types)

    assert types(["value", "arm.name", "unset"]) == [3, 4, ParameterType.PARAMETER_NOT_SET]
    assert types(["value", "missing"]) == []


def test_an_allowed_undeclared_parameter_is_not_set() -> None:
    node = Node(allow_undeclared=True)
    service = ParameterService(node)  # type: ignore[arg-type]
    assert list(node.call(GetParameterTypes, "get_parameter_types", names=["missing"]).types) == [0]
    assert node.call(GetParameters, "get_parameters", names=["missing"]).values == [ParameterValue()]
    del service


def test_descriptors_are_returned_all_or_none(node: Node) -> None:
    descriptors = node.call(DescribeParameters, "describe_parameters", names=["value"]).descriptors
    assert [(d.name, d.type, d.description) for d in descriptors] == [("value", 3, "a length [m]")]
    assert node.call(DescribeParameters, "describe_parameters", names=["value", "x"]).descriptors == []


def test_a_parameter_with_an_unknown_type_is_refused(node: Node) -> None:
    unknown = ParameterMsg(name="value", value=ParameterValue(type=200))
    results = node.call(SetParameters, "set_parameters", parameters=[unknown]).results
    assert [(result.successful, "200" in result.reason) for result in results] == [(False, True)]
    result = node.call(SetParametersAtomically, "set_parameters_atomically", parameters=[unknown]).result
    assert not result.successful


def test_the_services_do_not_keep_their_node_alive() -> None:
    node = Node()
    service = ParameterService(node)  # type: ignore[arg-type]
    callback = node.services["node/get_parameters"][1]
    del node
    with pytest.raises(ReferenceError):
        callback(GetParameters.Request(), GetParameters.Response())
    del service


def test_logger_levels_are_read_and_set() -> None:
    node = Node()
    LoggingService(node)  # type: ignore[arg-type]
    try:
        levels = [LoggerLevel(name="a", level=40), LoggerLevel(name="b", level=41)]
        results = node.call(SetLoggerLevels, "set_logger_levels", levels=levels).results
        assert [(result.successful, result.reason) for result in results] == [
            (True, ""),
            (False, "Failed reason: Invalid logger level."),
        ]
        got = node.call(GetLoggerLevels, "get_logger_levels", names=["a", "b"]).levels
        assert [(level.name, level.level) for level in got] == [("a", 40), ("b", 0)]
    finally:
        rclpy.logging.shutdown()
