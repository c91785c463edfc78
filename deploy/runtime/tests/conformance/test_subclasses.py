"""Subclasses of Node may use any private name without disturbing rclpy."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from deploy.runtime.tests.nodes import SpinUntil

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64

FOREIGN: dict[str, Any] = {
    "_arguments": ["some", "arguments"],
    "_destroyed": True,
    "_events": [],
    "_executor": object(),
    "_graph": {"a": ["b"]},
    "_name": None,
    "_namespace": 1,
    "_rates": 2.0,
}


def never_called(*arguments: object, **options: object) -> None:
    raise AssertionError("rclpy calls a private method of a user's class")


class Busy(Node):
    """A node with private attributes and methods as a user may name them."""

    _add = _change = _declare = _destroy = _entities = _resolve = _store = never_called

    def __init__(self, context: Context, *, first: bool) -> None:
        if first:
            vars(self).update(FOREIGN)
        super().__init__("busy", namespace="/ns", context=context)
        if not first:
            vars(self).update(FOREIGN)


@pytest.mark.parametrize("first", [True, False])
def test_a_subclass_may_use_any_private_name(
    context: Context, executor: SingleThreadedExecutor, spin_until: SpinUntil, first: bool
) -> None:
    node = Busy(context, first=first)
    executor.add_node(node)
    assert node.executor is executor
    assert node.get_fully_qualified_name() == "/ns/busy"
    assert node.resolve_topic_name("x") == "/ns/x"

    assert node.declare_parameter("a", 1).value == 1
    assert node.set_parameters([Parameter("a", value=2)])[0].successful
    assert node.get_parameter("a").value == 2

    heard: list[float] = []
    publisher = node.create_publisher(Float64, "x", 1)
    subscription = node.create_subscription(Float64, "x", lambda message: heard.append(message.data), 1)
    timer = node.create_timer(0.01, lambda: publisher.publish(Float64(data=1.0)))
    rate = node.create_rate(1.0)
    spin_until(lambda: heard)

    assert {name: vars(node)[name] for name in FOREIGN} == FOREIGN
    assert node.destroy_rate(rate)
    assert node.destroy_timer(timer)
    assert node.destroy_subscription(subscription)
    assert node.destroy_publisher(publisher)
    node.destroy_node()
    with pytest.raises(InvalidHandle):
        node.count_publishers("x")
    assert {name: vars(node)[name] for name in FOREIGN} == FOREIGN


class Threaded(SingleThreadedExecutor):
    """An executor that spins on a thread of its own, with names as users choose them."""

    def __init__(self, context: Context) -> None:
        super().__init__(context=context)
        self._ready, self._changed, self._timers, self._idle = None, None, None, None
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def _spin(self) -> None:
        self.spin()

    _run = _handle = _work = _collect = _begin = never_called


class Pool(MultiThreadedExecutor):
    def __init__(self, context: Context) -> None:
        super().__init__(2, context=context)
        self._threads, self._errors, self._pool, self._in_pool = [], {}, None, "none"
        self._thread = threading.Thread(target=self.spin, daemon=True)

    _spin = _run = _handle = _run_in_pool = never_called


@pytest.mark.parametrize("make", [Threaded, Pool])
def test_a_subclass_of_an_executor_may_use_any_private_name(
    context: Context, make: type[Threaded | Pool]
) -> None:
    called = threading.Event()
    node = Node("node", context=context)
    node.create_timer(0.01, called.set)
    executor = make(context)
    executor.add_node(node)
    executor._thread.start()
    assert called.wait(10)
    executor.shutdown()
    executor._thread.join(10)
    assert not executor._thread.is_alive()
    node.destroy_node()
