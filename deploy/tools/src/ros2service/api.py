"""The services of the graph, and their classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ros2cli import graph

if TYPE_CHECKING:
    from rclpy.node import Node


def get_service_names_and_types(
    *, node: Node, include_hidden_services: bool = False
) -> list[tuple[str, list[str]]]:
    """Return the services of the graph, each with its types."""
    services = node.get_service_names_and_types()
    return [it for it in services if include_hidden_services or not graph.is_hidden(it[0])]


def get_service_names(*, node: Node, include_hidden_services: bool = False) -> list[str]:
    services = get_service_names_and_types(node=node, include_hidden_services=include_hidden_services)
    return [name for name, _ in services]


def get_service_class(node: Node, service_name: str, include_hidden_services: bool) -> Any:
    """Return the class of a service. Raises RuntimeError if its type is unknown or not the only one."""
    services = get_service_names_and_types(node=node, include_hidden_services=include_hidden_services)
    types = dict(services).get(service_name)
    if types is None:
        raise RuntimeError(f"Cannot find type for '{service_name}'")
    if len(types) > 1:
        raise RuntimeError(f"The service '{service_name}' has more than one type: [{', '.join(types)}]")
    return graph.interface_class("service", types[0], f"The service type '{types[0]}' is invalid")
