"""The service ``~/get_type_description``, by which others learn what a type looks like (REP 2016)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_services_default

if TYPE_CHECKING:
    from rclpy.node import Node

START_TYPE_DESCRIPTION_SERVICE_PARAM = "start_type_description_service"


class TypeDescriptionService:
    """Describes types, unless the parameter ``start_type_description_service`` is false."""

    def __init__(self, node: Node) -> None:
        """Declare the parameter, and create the service if it says so."""
        self._node = node
        self._service: Any = None
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

            self._service = node.create_service(
                GetTypeDescription,
                "~/get_type_description",
                self._describe,
                qos_profile=qos_profile_services_default,
            )

    def destroy(self) -> None:
        """End the service."""
        if self._service is not None:
            self._node.destroy_service(self._service)
            self._service = None

    def _describe(self, request: Any, response: Any) -> Any:
        from rosidl_runtime_embedded.packages import definition_source
        from rosidl_runtime_embedded.type_description import type_description, type_hash
        from type_description_interfaces.msg import TypeSource

        try:
            if request.type_hash != type_hash(request.type_name):
                raise LookupError(f"type {request.type_name} has another hash than {request.type_hash}")
            description: Any = type_description(request.type_name)
        except (LookupError, ValueError) as error:
            response.successful, response.failure_reason = False, str(error)
            return response
        response.successful, response.type_description = True, description
        if request.include_type_sources:
            referenced = description.referenced_type_descriptions
            for name in [request.type_name, *(one.type_name for one in referenced)]:
                path, contents = definition_source(name)
                encoding = path.rpartition(".")[2]
                source = TypeSource(type_name=name, encoding=encoding, raw_file_contents=contents)
                response.type_sources.append(source)
        return response
