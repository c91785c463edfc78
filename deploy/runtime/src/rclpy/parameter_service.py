"""The services to get and set the parameters of a node (`ros2 param`)."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import ListParametersResult, SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.exceptions import ParameterNotDeclaredException, ParameterUninitializedException
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameters

if TYPE_CHECKING:
    from rclpy.node import Node


class ParameterService:
    """The six parameter services of a node. They do not keep the node alive."""

    def __init__(self, node: Node) -> None:
        self._node_weak_ref = weakref.ref(node)
        services: dict[str, tuple[Any, Any]] = {
            "describe_parameters": (DescribeParameters, self._rclpy_describe_parameters),
            "get_parameters": (GetParameters, self._rclpy_get_parameters),
            "get_parameter_types": (GetParameterTypes, self._rclpy_get_parameter_types),
            "list_parameters": (ListParameters, self._rclpy_list_parameters),
            "set_parameters": (SetParameters, self._rclpy_set_parameters),
            "set_parameters_atomically": (SetParametersAtomically, self._rclpy_set_parameters_atomically),
        }
        for name, (service_type, callback) in services.items():
            node.create_service(
                service_type, f"{node.get_name()}/{name}", callback, qos_profile=qos_profile_parameters
            )

    def _rclpy_describe_parameters(
        self, request: DescribeParameters.Request, response: DescribeParameters.Response
    ) -> DescribeParameters.Response:
        try:
            response.descriptors = self._get_node().describe_parameters(list(request.names))
        except ParameterNotDeclaredException:
            # No partial result: descriptors could not be assigned to names.
            response.descriptors = []
        return response

    def _rclpy_get_parameters(
        self, request: GetParameters.Request, response: GetParameters.Response
    ) -> GetParameters.Response:
        try:
            parameters = self._get_node().get_parameters(list(request.names))
        except (ParameterNotDeclaredException, ParameterUninitializedException):
            parameters = []
        response.values = [parameter.get_parameter_value() for parameter in parameters]
        return response

    def _rclpy_get_parameter_types(
        self, request: GetParameterTypes.Request, response: GetParameterTypes.Response
    ) -> GetParameterTypes.Response:
        try:
            types: list[Any] = list(self._get_node().get_parameter_types(list(request.names)))
        except ParameterNotDeclaredException:
            types = []
        # The type of an undeclared parameter is a member of an enumeration, that of others a number.
        response.types = [getattr(type_, "value", type_) for type_ in types]
        return response

    def _rclpy_list_parameters(
        self, request: ListParameters.Request, response: ListParameters.Response
    ) -> ListParameters.Response:
        try:
            response.result = self._get_node().list_parameters(list(request.prefixes), request.depth)
        except (TypeError, ValueError):
            response.result = ListParametersResult()
        return response

    def _rclpy_set_parameters(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        response.results = [self._rclpy_set([message]) for message in request.parameters]
        return response

    def _rclpy_set_parameters_atomically(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        response.result = self._rclpy_set(request.parameters)
        return response

    def _rclpy_set(self, messages: Any) -> SetParametersResult:
        """Set all parameters of these messages or none."""
        try:
            parameters = [Parameter.from_parameter_msg(message) for message in messages]
        except ValueError as error:
            # The number of the type is unknown.
            return SetParametersResult(successful=False, reason=str(error))
        try:
            return self._get_node().set_parameters_atomically(parameters)
        except ParameterNotDeclaredException as error:
            return SetParametersResult(successful=False, reason=str(error))

    def _get_node(self) -> Node:
        node = self._node_weak_ref()
        if node is None:
            raise ReferenceError("Expected valid node weak reference")
        return node
