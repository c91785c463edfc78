"""rclpy with plain callbacks. As in the C program, a source has one message, and the middle passes it on."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_msgs.msg import UInt8MultiArray

from tests.benchmarks.link import Item, Job, Link


class Connection(Link):
    make_node: Callable[[str], Node] = Node
    make_executor: Callable[[], Executor] = SingleThreadedExecutor

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        rclpy.init(args=[])
        self.node = type(self).make_node(job.role)
        self.executor = type(self).make_executor()
        self.executor.add_node(self.node)
        self.qos = QoSProfile(depth=job.depth)

    def publisher(self, topic: str) -> Callable[[Item], object]:
        publisher = self.node.create_publisher(UInt8MultiArray, topic, self.qos)
        message = UInt8MultiArray(data=array("B", bytes(self.job.size)))

        def send(item: Item) -> None:
            message.data[:8] = item[:8]
            publisher.publish(message)

        return send

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        def receive(message: Any) -> None:
            on_item(message.data)

        self.node.create_subscription(UInt8MultiArray, topic, receive, self.qos)

    def forward(self, source: str, target: str) -> None:
        publisher = self.node.create_publisher(UInt8MultiArray, target, self.qos)
        self.node.create_subscription(UInt8MultiArray, source, publisher.publish, self.qos)

    def wait(self, seconds: float) -> None:
        self.executor.spin_until_future_complete(Future(), seconds)

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.try_shutdown()
