"""The topics of the graph, and the classes of their messages."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from ros2cli import graph

if TYPE_CHECKING:
    from rclpy.node import Node

_PERIOD = 0.02
"""Period at which the graph is looked at [s]."""


def get_topic_names_and_types(
    *, node: Node, include_hidden_topics: bool = False
) -> list[tuple[str, list[str]]]:
    """Return the topics that have a publisher or subscription, each with its types."""
    topics = node.get_topic_names_and_types()
    return [it for it in topics if include_hidden_topics or not graph.is_hidden(it[0])]


def get_topic_names(*, node: Node, include_hidden_topics: bool = False) -> list[str]:
    topics = get_topic_names_and_types(node=node, include_hidden_topics=include_hidden_topics)
    return [name for name, _ in topics]


def get_msg_class(
    node: Node, topic: str, blocking: bool = False, include_hidden_topics: bool = False
) -> Any | None:
    """Return the class of a topic's messages; print a warning if nobody publishes or subscribes to it yet.

    :param blocking: wait for the topic; otherwise return ``None``.
    :raises RuntimeError: if the name is invalid, or the type is unknown or not the only one.
    """
    found = _message_class(node, topic, include_hidden_topics)
    if found is None:
        print(f"WARNING: topic [{topic}] does not appear to be published yet")
    while blocking and found is None and node.context.ok():
        time.sleep(_PERIOD)
        found = _message_class(node, topic, include_hidden_topics)
    return found


def _message_class(node: Node, topic: str, include_hidden_topics: bool) -> Any | None:
    topics = get_topic_names_and_types(node=node, include_hidden_topics=include_hidden_topics)
    types = dict(topics).get(graph.full_topic_name(node, topic))
    if types is None:
        return None
    if len(types) > 1:
        raise RuntimeError(
            f"Cannot echo topic '{topic}', as it contains more than one type: [{', '.join(types)}]"
        )
    return graph.interface_class("message", types[0], f"The message type '{types[0]}' is invalid")
