"""What a publisher, subscription, service or client stands on: DDS entities that belong to a node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rclpy._dds import Reader, Writer

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
    """Where a service or client writes and reads, its node, and the service's fully qualified name."""

    node: Node
    name: str
    writer: Writer
    reader: Reader
