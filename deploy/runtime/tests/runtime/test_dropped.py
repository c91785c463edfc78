"""Objects dropped without destruction: the garbage collector removes them and their DDS entities."""

from __future__ import annotations

import gc
import signal
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode

import rclpy
from example_interfaces.action import Fibonacci
from rclpy._dds.library import blocking
from rclpy.action import ActionClient, ActionServer
from rclpy.context import Context
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.impl import _logging_output
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64
from std_srvs.srv import Trigger


class FullNode(Node):
    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.create_publisher(Float64, "x", 1)
        self.create_subscription(Float64, "x", self.hear, 1)
        self.create_service(Trigger, "trigger", lambda request, response: response)
        self.create_client(Trigger, "trigger")
        self.create_timer(1.0, self.destroy_node)
        self.create_guard_condition(self.destroy_node)
        self.create_rate(1.0)
        self.action_server = ActionServer(self, Fibonacci, "fibonacci", self.reach)
        self.action_client = ActionClient(self, Fibonacci, "fibonacci")

    def hear(self, message: Float64) -> None:
        pass

    def reach(self, goal_handle: Any) -> Any:
        pass


class FailingNode(FullNode):
    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        raise ZeroDivisionError("planted")


def sees_no_other(node: Node) -> bool:
    ends = node.count_publishers("x"), node.count_subscribers("x"), node.count_services("trigger")
    return node.get_node_names() == [node.get_name()] and ends == (0, 0, 0)


def becomes_true(node: Node, condition: Callable[[], bool]) -> bool:
    return node._rclpy_graph.wait_for(condition, 10, node.context.ok)


def becomes_true_after_collection(condition: Callable[[], bool]) -> bool:
    """Collect repeatedly: the thread of an executor's last callback may hold it a moment longer."""
    deadline = time.monotonic() + 10
    while not condition() and time.monotonic() < deadline:
        gc.collect()
    return condition()


def test_a_dropped_node_leaves_the_graph(make_node: MakeNode, context: Context) -> None:
    other = make_node("other")
    node = FullNode("dropped", context=context)
    node.get_logger().info("here", once=True)
    dropped = weakref.ref(node)
    assert other.count_subscribers("x") == 1
    del node
    gc.collect()
    assert dropped() is None
    assert becomes_true(other, lambda: sees_no_other(other))
    assert becomes_true(other, lambda: "dropped" not in _logging_output._rosout)


def test_a_node_whose_subclass_fails_leaves_the_graph(make_node: MakeNode, context: Context) -> None:
    other = make_node("other")
    with pytest.raises(ZeroDivisionError, match="planted"):
        FailingNode("dropped", context=context)
    gc.collect()
    assert becomes_true(other, lambda: sees_no_other(other))


@pytest.mark.parametrize("parameter", ["use_sim_time", "start_type_description_service"])
def test_a_node_whose_constructor_fails_leaves_nothing(
    make_node: MakeNode, context: Context, parameter: str
) -> None:
    other = make_node("other")
    gc.disable()
    try:
        with pytest.raises(InvalidParameterTypeException):
            Node("failing", context=context, parameter_overrides=[Parameter(parameter, value="wrong")])
        assert sees_no_other(other)
        assert "failing" not in _logging_output._rosout
        assert len(other.get_publishers_info_by_topic("/parameter_events")) == 1
    finally:
        gc.enable()


def test_dropping_a_node_waits_for_no_lock(make_node: MakeNode, context: Context) -> None:
    """The garbage collector may run while another thread holds the lock and waits for this thread."""
    other = make_node("other")
    dropped = weakref.ref(FullNode("dropped", context=context))
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
    assert becomes_true(other, lambda: sees_no_other(other))


def test_dropping_the_last_node_after_shutdown_leaves_the_domain(domain_id: int) -> None:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    node = FullNode("dropped", context=context)
    listener = node._rclpy_graph._listener
    context.shutdown()
    assert listener.is_alive()
    del node
    gc.collect()
    listener.join(10)
    assert not listener.is_alive()
    assert context._rclpy_graph is None


@pytest.mark.parametrize("kind", [SingleThreadedExecutor, MultiThreadedExecutor])
def test_a_dropped_executor_leaves_nothing_in_dds(
    make_node: MakeNode, context: Context, kind: type[Executor]
) -> None:
    executor = kind(context=context)
    task = executor.create_task(lambda: 42)
    executor.spin_until_future_complete(task, 10)
    assert task.result() == 42
    dropped = weakref.ref(executor)
    handles = [entity.handle for entity in executor._rclpy_dds]
    assert all(blocking.dds_triggered(handle) >= 0 for handle in handles)
    del executor
    assert becomes_true_after_collection(lambda: dropped() is None), gc.get_referrers(dropped())
    assert becomes_true_after_collection(lambda: all(blocking.dds_triggered(it) < 0 for it in handles))


def test_a_signal_keeps_no_executor(context: Context) -> None:
    executor = SingleThreadedExecutor(context=context)
    woken = threading.Event()
    executor.wake = woken.set  # type: ignore[method-assign]
    dropped = weakref.ref(executor)
    before = signal.signal(signal.SIGUSR1, lambda *_: None)
    try:
        signal.raise_signal(signal.SIGUSR1)
        assert woken.wait(10)
    finally:
        signal.signal(signal.SIGUSR1, before)
    del executor
    assert becomes_true_after_collection(lambda: dropped() is None), gc.get_referrers(dropped())


def test_a_context_drops_the_shutdown_callbacks_of_dead_objects(context: Context) -> None:
    class Listener:
        def hear(self) -> None: ...

    context.on_shutdown(Listener().hear)
    assert context._callbacks == []
