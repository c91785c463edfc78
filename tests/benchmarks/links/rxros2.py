"""An observable in the style of rxros2: a subject that a plain subscription feeds, without a scheduler."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reactivex import operators
from reactivex.subject import Subject
from std_msgs.msg import UInt8MultiArray

from tests.benchmarks.links import callbacks


class Connection(callbacks.Connection):
    """A node whose subscriptions feed subjects, and whose publisher observes."""

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        def receive(message: Any) -> None:
            on_item(message.data)

        self._from_topic(topic).subscribe(receive)

    def forward(self, source: str, target: str) -> None:
        publisher = self.node.create_publisher(UInt8MultiArray, target, self.qos)
        self._from_topic(source).pipe(operators.map(lambda message: message)).subscribe(publisher.publish)

    def _from_topic(self, topic: str) -> Subject[Any]:
        items: Subject[Any] = Subject()
        self.node.create_subscription(UInt8MultiArray, topic, items.on_next, self.qos)
        return items
