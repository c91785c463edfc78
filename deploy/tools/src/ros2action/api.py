"""The actions of the graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy import action
from ros2cli import graph

if TYPE_CHECKING:
    from rclpy.node import Node

_NodesAndTypes = list[tuple[str, list[str]]]


def get_action_names_and_types(*, node: Node) -> list[tuple[str, list[str]]]:
    """Return the actions of the graph, each with its types."""
    return action.get_action_names_and_types(node)


def get_action_clients_and_servers(*, node: Node, action_name: str) -> tuple[_NodesAndTypes, _NodesAndTypes]:
    """Return the nodes with a client and with a server of an action. Raises RuntimeError if invalid."""
    full_name = graph.full_topic_name(node, action_name)
    clients: _NodesAndTypes = []
    servers: _NodesAndTypes = []
    for one in graph.node_names(node, include_hidden=True):
        for found, ask in (
            (clients, action.get_action_client_names_and_types_by_node),
            (servers, action.get_action_server_names_and_types_by_node),
        ):
            actions = dict(ask(node, one.name, one.namespace))
            if full_name in actions:
                found.append((one.full_name, actions[full_name]))
    return clients, servers


def get_action_names(*, node: Node) -> list[str]:
    return [name for name, _ in get_action_names_and_types(node=node)]
