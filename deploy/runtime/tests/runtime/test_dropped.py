"""What nobody ends, but nobody keeps either: the garbage collector takes it, and nothing of it stays."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

import pytest

import rclpy
from rclpy._dds.library import blocking
from rclpy.context import Context
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.impl import _logging_output
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

MakeNode = Callable[..., Node]


class Furnished(Node):
    """A node with one of everything."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.create_publisher(Float64, "x", 1)
        self.create_subscription(Float64, "x", self.hear, 1)
        self.create_service(Trigger, "trigger", lambda request, response: response)
        self.create_client(Trigger, "trigger")
        self.create_timer(1.0, self.destroy_node)
        self.create_guard_condition(self.destroy_node)
        self.create_rate(1.0)

    def hear(self, message: Float64) -> None:
        pass


class Failing(Furnished):
    """A node whose subclass cannot be made."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        raise ZeroDivisionError("planted")


def is_alone(node: Node) -> bool:
    """Whether `node` knows of no other node, and of no endpoints but its own."""
    ends = node.count_publishers("x"), node.count_subscribers("x"), node.count_services("trigger")
    return node.get_node_names() == [node.get_name()] and ends == (0, 0, 0)


def comes_true(node: Node, condition: Callable[[], bool]) -> bool:
    return node._rclpy_graph.wait_for(condition, 10, node.context.ok)


def comes_true_by_collecting(condition: Callable[[], bool]) -> bool:
    """Whether it does: the thread that ran an executor's last callback holds it for a moment longer."""
    deadline = time.monotonic() + 10
    while not condition() and time.monotonic() < deadline:
        gc.collect()
    return condition()


def test_a_node_that_is_dropped_leaves_the_graph(make_node: MakeNode, context: Context) -> None:
    other = make_node("other")
    node = Furnished("dropped", context=context)
    node.get_logger().info("here", once=True)
    dropped = weakref.ref(node)
    assert other.count_subscribers("x") == 1
    del node
    gc.collect()
    assert dropped() is None
    assert comes_true(other, lambda: is_alone(other))
    assert comes_true(other, lambda: "dropped" not in _logging_output._rosout)


def test_a_node_whose_subclass_fails_leaves_the_graph(make_node: MakeNode, context: Context) -> None:
    other = make_node("other")
    with pytest.raises(ZeroDivisionError, match="planted"):
        Failing("dropped", context=context)
    gc.collect()
    assert comes_true(other, lambda: is_alone(other))


@pytest.mark.parametrize("parameter", ["use_sim_time", "start_type_description_service"])
def test_a_node_that_cannot_be_made_leaves_nothing(
    make_node: MakeNode, context: Context, parameter: str
) -> None:
    other = make_node("other")
    gc.disable()
    try:
        with pytest.raises(InvalidParameterTypeException):
            Node("failing", context=context, parameter_overrides=[Parameter(parameter, value="wrong")])
        assert is_alone(other)
        assert "failing" not in _logging_output._rosout
        assert len(other.get_publishers_info_by_topic("/parameter_events")) == 1
    finally:
        gc.enable()


def test_a_node_that_is_dropped_waits_for_no_lock(make_node: MakeNode, context: Context) -> None:
    """The garbage collector may come while another thread holds the lock, and waits for this one."""
    other = make_node("other")
    dropped = weakref.ref(Furnished("dropped", context=context))
    held, free = threading.Event(), threading.Event()

    def hold() -> None:
        with other._rclpy_graph._lock, _logging_output._rosout_lock, context._lock:
            held.set()
            free.wait(10)

    holder = threading.Thread(target=hold)
    holder.start()
    held.wait(10)
    gc.collect()
    assert dropped() is None
    assert not free.is_set()
    assert holder.is_alive()
    free.set()
    holder.join()
    assert comes_true(other, lambda: is_alone(other))


def test_the_last_node_that_is_dropped_after_the_shutdown_leaves_the_domain(domain_id: int) -> None:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    node = Furnished("dropped", context=context)
    listener = node._rclpy_graph._listener
    context.shutdown()
    assert listener.is_alive()
    del node
    gc.collect()
    listener.join(10)
    assert not listener.is_alive()
    assert context._graph is None


@pytest.mark.parametrize("kind", [SingleThreadedExecutor, MultiThreadedExecutor])
def test_an_executor_that_is_dropped_leaves_nothing_in_dds(
    make_node: MakeNode, context: Context, kind: type[Executor]
) -> None:
    executor = kind(context=context)
    task = executor.create_task(lambda: 42)
    executor.spin_until_future_complete(task, 10)
    assert task.result() == 42
    dropped = weakref.ref(executor)
    handles = [entity.handle for entity in executor._dds]
    assert all(blocking.dds_triggered(handle) >= 0 for handle in handles)
    del executor
    assert comes_true_by_collecting(
        lambda: dropped() is None and all(blocking.dds_triggered(handle) < 0 for handle in handles)
    )
