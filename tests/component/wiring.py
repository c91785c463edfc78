"""A wired service in the process of its test, with a peer that feeds it and records its outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time

from interfaces.service import ServiceNode
from interfaces.topics import DIAGNOSTICS, Topic
from reactive_node.testing import MakeNode, SpinUntil


class Wired:
    def __init__(
        self,
        make_node: MakeNode,
        spin_until: SpinUntil,
        wire: Callable[[ServiceNode], None],
        *,
        inputs: Sequence[Topic] = (),
        outputs: Sequence[Topic] = (),
        namespace: str = "",
        **parameters: Any,
    ) -> None:
        self.spin_until = spin_until
        self.peer: Node = make_node("peer", kind=Node, namespace=namespace)
        self.heard: dict[str, list[Any]] = {}
        for topic in {each.name: each for each in (*outputs, DIAGNOSTICS)}.values():
            heard = self.heard[topic.name] = []
            self.peer.create_subscription(topic.type, topic.name, heard.append, topic.qos)
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.service: ServiceNode = make_node(
            "service", kind=ServiceNode, namespace=namespace, parameter_overrides=overrides
        )
        wire(self.service)
        self._publishers = {
            topic.name: self.peer.create_publisher(topic.type, topic.name, topic.qos) for topic in inputs
        }
        names = {self.service.resolve_topic_name(topic.name) for topic in outputs}
        assert names <= {each.topic_name for each in self.service.publishers}
        own = [each.topic_name for each in self.service.subscriptions]  # it may hear itself
        # With ROS 2, get_subscription_count would take the event `matched` away from health.
        spin_until(lambda: all(self.service.count_subscribers(name) > own.count(name) for name in names))
        spin_until(self.reports)  # the peer hears all further ones

    def publish(self, topic: Topic, message: Any) -> None:
        publisher = self._publishers[topic.name]
        own = topic.name in self.heard  # the peer may hear itself
        self.spin_until(lambda: publisher.get_subscription_count() > own)
        publisher.publish(message)

    def reports(self) -> list[dict[str, str]]:
        """Return the health reports so far: the message and the values of each."""
        return [
            {"message": status.message, **{pair.key: pair.value for pair in status.values}}
            for message in self._health()
            for status in message.status
        ]

    def remarks(self) -> list[str]:
        """Let the service report, and return the warnings of all reports so far."""
        before = self.service.get_clock().now()
        self.service.health.report()
        self.spin_until(lambda: Time.from_msg(self._health()[-1].header.stamp) >= before)
        return [report["message"] for report in self.reports() if report["message"] != "running"]

    def _health(self) -> list[Any]:
        name = self.service.get_fully_qualified_name()
        return [message for message in self.heard[DIAGNOSTICS.name] if message.status[0].name == name]


Connect = Callable[..., Wired]
"""Connects a wired service with a peer: :class:`Wired` without its first two arguments."""
