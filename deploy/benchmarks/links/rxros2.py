"""An observable in the style of rxros2: a subject that a plain subscription feeds, without a scheduler."""

from __future__ import annotations

from typing import Any

from reactivex import operators
from reactivex.subject import Subject
from std_msgs.msg import UInt8MultiArray

from deploy.benchmarks.links import callbacks


def _copy(message: Any) -> Any:
    return UInt8MultiArray(data=message.data)


class Connection(callbacks.Connection):
    """A node whose subscription feeds a subject, and whose publisher observes."""

    def forward(self, source: str, target: str) -> None:
        items: Subject[Any] = Subject()
        publisher = self.node.create_publisher(UInt8MultiArray, target, self.qos)
        copies = items.pipe(operators.map(_copy))
        copies.subscribe(publisher.publish)
        self.node.create_subscription(UInt8MultiArray, source, items.on_next, self.qos)
