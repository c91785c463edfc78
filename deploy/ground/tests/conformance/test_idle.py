"""An executor without work sleeps: it does not poll."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String


def wakes(act: Callable[[], object]) -> int:
    """Return how often this thread has slept and woken up during an action (getrusage(2))."""
    before = resource.getrusage(resource.RUSAGE_THREAD)
    act()
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw - before.ru_nvcsw


def test_idle_executor_sleeps_until_its_timeout(node: Node, executor: SingleThreadedExecutor) -> None:
    node.create_subscription(String, "x", lambda _: None, 10)
    node.create_timer(3600.0, lambda: None)
    until = time.monotonic() + 0.5
    while time.monotonic() < until:  # discovery of the node itself
        executor.spin_once(timeout_sec=0.05)

    assert wakes(lambda: executor.spin_once(timeout_sec=1.0)) < 50
