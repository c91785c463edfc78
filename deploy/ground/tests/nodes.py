"""What tests do with nodes: the types of their fixtures, a topic within one node, spinning in a thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float64

MakeNode = Callable[..., Node]
SpinUntil = Callable[..., None]
Call = Callable[..., Any]


def subscribe(node: Node, topic: str = "x", **options: Any) -> tuple[list[float], Callable[[float], None]]:
    """Subscribe to a topic of the node's own; return what is received, and a function that publishes."""
    received: list[float] = []
    node.create_subscription(Float64, topic, lambda message: received.append(message.data), 10, **options)
    publisher = node.create_publisher(Float64, topic, 10)
    return received, lambda value: publisher.publish(Float64(data=value))


@contextmanager
def spinning(executor: Executor, node: Node) -> Iterator[None]:
    """Spin a node in a thread until the end of the block.

    The thread ends before the executor: rclpy's own must not be shut down while it looks for work.
    """
    executor.add_node(node)
    end = Future()
    thread = threading.Thread(target=executor.spin_until_future_complete, args=(end,))
    thread.start()
    try:
        yield
    finally:
        end.set_result(None)
        thread.join()
        executor.shutdown()
