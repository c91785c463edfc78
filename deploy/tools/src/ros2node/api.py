"""The nodes of the graph, and what each of them has."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from rclpy import action
from ros2cli import graph
from ros2cli.graph import NodeName

if TYPE_CHECKING:
    from rclpy.node import Node


class TopicInfo(NamedTuple):
    """The name of a topic, service or action, and its types."""

    name: str
    types: list[str]


def get_absolute_node_name(node_name: str) -> str | None:
    """Return a node's name with its leading slash; ``None`` if it is empty."""
    return f"/{node_name.removeprefix('/')}" if node_name else None


def parse_node_name(node_name: str) -> NodeName:
    """Return the parts of a node's full name, which may lack its leading slash."""
    full_name = f"/{node_name.removeprefix('/')}"
    namespace, _, name = full_name.rpartition("/")
    return NodeName(name, namespace or "/", full_name)


def get_node_names(*, node: Node, include_hidden_nodes: bool = False) -> list[NodeName]:
    """Return the names of the nodes in the graph."""
    return graph.node_names(node, include_hidden=include_hidden_nodes)


def get_publisher_info(*, node: Node, remote_node_name: str, include_hidden: bool = False) -> list[TopicInfo]:
    """Return the topics that a node publishes."""
    return _info(node.get_publisher_names_and_types_by_node, remote_node_name, include_hidden)


def get_subscriber_info(
    *, node: Node, remote_node_name: str, include_hidden: bool = False
) -> list[TopicInfo]:
    """Return the topics to which a node subscribes."""
    return _info(node.get_subscriber_names_and_types_by_node, remote_node_name, include_hidden)


def get_service_server_info(
    *, node: Node, remote_node_name: str, include_hidden: bool = False
) -> list[TopicInfo]:
    return _info(node.get_service_names_and_types_by_node, remote_node_name, include_hidden)


def get_service_client_info(
    *, node: Node, remote_node_name: str, include_hidden: bool = False
) -> list[TopicInfo]:
    """Return the services that a node calls."""
    return _info(node.get_client_names_and_types_by_node, remote_node_name, include_hidden)


def get_action_server_info(
    *, node: Node, remote_node_name: str, include_hidden: bool = False
) -> list[TopicInfo]:
    """Return the actions that a node serves."""

    def ask(name: str, namespace: str) -> list[tuple[str, list[str]]]:
        return action.get_action_server_names_and_types_by_node(node, name, namespace)

    return _info(ask, remote_node_name, include_hidden)


def get_action_client_info(
    *, node: Node, remote_node_name: str, include_hidden: bool = False
) -> list[TopicInfo]:
    """Return the actions that a node sends goals to."""

    def ask(name: str, namespace: str) -> list[tuple[str, list[str]]]:
        return action.get_action_client_names_and_types_by_node(node, name, namespace)

    return _info(ask, remote_node_name, include_hidden)


def _info(
    ask: Callable[[str, str], list[tuple[str, list[str]]]], remote_node_name: str, include_hidden: bool
) -> list[TopicInfo]:
    remote = parse_node_name(remote_node_name)
    found = ask(remote.name, remote.namespace)
    return [TopicInfo(name, types) for name, types in found if include_hidden or not graph.is_hidden(name)]
