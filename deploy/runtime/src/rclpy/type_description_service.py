"""The service ``~/get_type_description``, which returns the definition of a type (REP 2016)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_services_default
from rclpy.type_hash import TypeHash

if TYPE_CHECKING:
    from rclpy.node import Node

START_TYPE_DESCRIPTION_SERVICE_PARAM = "start_type_description_service"

_NOT_IN_USE = "Type not currently in use by this node"


class TypeDescriptionService:
    """Describes the types of a node, unless its parameter ``start_type_description_service`` is false."""

    def __init__(self, node: Node) -> None:
        self._rclpy_node = node
        self._rclpy_service: Any = None
        from rcl_interfaces.msg import ParameterDescriptor

        name = START_TYPE_DESCRIPTION_SERVICE_PARAM
        if not node.has_parameter(name):
            descriptor = ParameterDescriptor(
                name=name,
                type=Parameter.Type.BOOL.value,
                description="If enabled, start the ~/get_type_description service.",
                read_only=True,
            )
            node.declare_parameter(name, True, descriptor)
        if node.get_parameter(name).value:
            from type_description_interfaces.srv import GetTypeDescription

            self._rclpy_service = node._rclpy_create_service(
                GetTypeDescription,
                "~/get_type_description",
                self._rclpy_describe,
                qos_profile=qos_profile_services_default,
            )

    def destroy(self) -> None:
        if self._rclpy_service is not None:
            self._rclpy_node._rclpy_destroy_service(self._rclpy_service)
            self._rclpy_service = None

    def _rclpy_describe(self, request: Any, response: Any) -> Any:
        """Answer as rcl does: the hash identifies the type, which must be in use; its name is ignored."""
        from rosidl_runtime_embedded.type_description import type_description, type_sources

        names = {used._TYPE_HASH: used._TYPE_NAME for used in list(self._rclpy_node._rclpy_used_types)}
        name = names.get(request.type_hash)
        if name is None:
            known = TypeHash._rclpy_parse(request.type_hash) != TypeHash()
            response.failure_reason = _NOT_IN_USE if known else "Failed to parse type hash"
            return response
        response.successful, response.type_description = True, type_description(name)
        if request.include_type_sources:
            response.type_sources = type_sources(response.type_description)
        return response
