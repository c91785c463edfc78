"""DDS entities that belong to a node: the base of publishers, subscriptions, services and clients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rclpy._dds import Reader, Writer
from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle

if TYPE_CHECKING:
    from rclpy.node import Node


@dataclass(frozen=True)
class PublisherEndpoint:
    """The DDS writer of a publisher, its node, and the topic's fully qualified name."""

    node: Node
    name: str
    writer: Writer


@dataclass(frozen=True)
class SubscriptionEndpoint:
    """The DDS reader of a subscription, its node, and the topic's fully qualified name."""

    node: Node
    name: str
    reader: Reader


@dataclass(frozen=True)
class ServiceEndpoint:
    """The DDS writer and reader of a service or client, its node, and the service's fully qualified name.

    Writer and reader announce the identifier in USER_DATA.
    """

    node: Node
    name: str
    writer: Writer
    reader: Reader
    identifier: bytes


class Owner:
    """Base of publishers and subscriptions: uses DDS entities of a node until it is destroyed."""

    def __init__(self, node: Node, name: str, *entities: Writer | Reader) -> None:
        self._rclpy_node = node
        self._rclpy_name = name
        self._rclpy_entities = entities
        self._rclpy_destroyed = False
        self.event_handlers: list[EventHandler] = []

    def _rclpy_check_usable(self) -> None:
        if self._rclpy_destroyed:
            kind = type(self).__name__.lower()
            raise InvalidHandle(f"cannot use a {kind} of {self._rclpy_name} that was destroyed")

    @property
    def logger_name(self) -> str:
        """The name of the logger of its node. Raises InvalidHandle if it was destroyed."""
        self._rclpy_check_usable()
        return self._rclpy_node.get_logger().name

    def destroy(self) -> None:
        """Destroy it. The node's ``destroy_…`` method also removes it from the node."""
        if not self._rclpy_destroyed:
            self._rclpy_destroyed = True
            for handler in self.event_handlers:
                handler.destroy()
            self._rclpy_node._rclpy_graph.destroy(self._rclpy_node, *self._rclpy_entities)
