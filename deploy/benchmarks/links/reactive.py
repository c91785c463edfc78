"""This system: ReactiveNode."""

from __future__ import annotations

from std_msgs.msg import UInt8MultiArray

from deploy.benchmarks.links import callbacks
from reactive_node import ReactiveNode


class Connection(callbacks.Connection):
    """A reactive node; its middle process is one recipe."""

    make_node = ReactiveNode
    node: ReactiveNode

    def forward(self, source: str, target: str) -> None:
        items = self.node.create_observable(UInt8MultiArray, source, self.qos)
        copies = items.map(lambda message: UInt8MultiArray(data=message.data))
        self.node.publish_observable(copies, UInt8MultiArray, target, self.qos)
