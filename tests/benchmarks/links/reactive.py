"""This system: ReactiveNode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_msgs.msg import UInt8MultiArray

from reactive_node import ReactiveNode
from reactive_node.executor import create_executor
from tests.benchmarks.links import callbacks


class Connection(callbacks.Connection):
    """A reactive node: its topics are observables, its middle process is one recipe."""

    make_node = ReactiveNode
    make_executor = staticmethod(create_executor)
    node: ReactiveNode

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        def receive(message: Any) -> None:
            on_item(message.data)

        items = self.node.create_observable(UInt8MultiArray, topic, self.qos)
        items.subscribe(receive, scheduler=self.node.scheduler)

    def forward(self, source: str, target: str) -> None:
        items = self.node.create_observable(UInt8MultiArray, source, self.qos)
        mapped = items.map(lambda message: message)  # a recipe has at least one operator
        self.node.publish_observable(mapped, UInt8MultiArray, target, self.qos)
