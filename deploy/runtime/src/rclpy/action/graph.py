"""The actions in the ROS graph, and their nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

_TOPIC = "/_action/feedback"
_TYPE = "_FeedbackMessage"

NamesAndTypes = list[tuple[str, list[str]]]


def get_action_client_names_and_types_by_node(
    node: Node, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """Ask ``node`` which actions another one calls, and their types. Raises NodeNameNonExistentError."""
    return _actions(node.get_subscriber_names_and_types_by_node(remote_node_name, remote_node_namespace))


def get_action_server_names_and_types_by_node(
    node: Node, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """Ask ``node`` which actions another one serves, and their types. Raises NodeNameNonExistentError."""
    return _actions(node.get_publisher_names_and_types_by_node(remote_node_name, remote_node_namespace))


def get_action_names_and_types(node: Node) -> NamesAndTypes:
    """Return all actions that have a server or client, with their types."""
    return _actions(node.get_topic_names_and_types())


def _actions(topics: NamesAndTypes) -> NamesAndTypes:
    return [
        (name.removesuffix(_TOPIC), [type_.removesuffix(_TYPE) for type_ in types])
        for name, types in topics
        if name.endswith(_TOPIC)
    ]
