"""Executors that are shut down, or fail, at bad moments."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest
from deploy.runtime.tests.conformance.test_executors import OwnExecutor

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.executors import (
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from std_msgs.msg import Float64

MakeNode = Callable[..., Node]
SpinUntil = Callable[..., None]


def test_shut_down_between_taking_and_running_an_executor_runs_what_it_took(
    make_node: MakeNode, context: Context
) -> None:
    node = make_node()
    executor = MultiThreadedExecutor(2, context=context)

    class Untimely(MutuallyExclusiveCallbackGroup):
        """Its entity is about to be taken when a signal's handler shuts the executor down."""

        def beginning_execution(self, entity: object) -> bool:
            executor.shutdown(timeout_sec=0)
            return super().beginning_execution(entity)

    group = Untimely()
    called: list[bool] = []
    guard = node.create_guard_condition(lambda: called.append(True), group)
    executor.add_node(node)
    guard.trigger()
    executor.spin_once(timeout_sec=5)
    assert executor.shutdown(timeout_sec=10)
    assert called == [True]
    assert group.can_execute(guard)


def test_a_message_that_cannot_be_taken_does_not_keep_its_callback_group_busy(
    executor: SingleThreadedExecutor, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    received: list[float] = []
    subscription = node.create_subscription(Float64, "x", lambda message: received.append(message.data), 10)
    publisher = node.create_publisher(Float64, "x", 10)

    def fail(data: bytes) -> None:
        raise ZeroDivisionError("planted")

    with monkeypatch.context() as patch:
        patch.setattr(subscription, "_deserialize", fail)
        publisher.publish(Float64(data=1.0))
        with pytest.raises(ZeroDivisionError, match="planted"):
            executor.spin_once(timeout_sec=5)
    publisher.publish(Float64(data=2.0))
    spin_until(lambda: received)
    assert received == [2.0]


def test_a_node_has_no_executor_once_that_was_shut_down(executor: SingleThreadedExecutor, node: Node) -> None:
    executor.shutdown()
    assert node.executor is None


def test_a_callback_that_ends_on_another_thread_lets_the_next_of_its_group_run(
    make_node: MakeNode, context: Context
) -> None:
    with OwnExecutor(context=context) as own_executor:
        node = make_node()
        own_executor.add_node(node)
        group = MutuallyExclusiveCallbackGroup()
        node.create_subscription(Float64, "x", lambda message: None, 10, callback_group=group)
        node.create_subscription(Float64, "x", lambda message: None, 10, callback_group=group)
        node.create_publisher(Float64, "x", 10).publish(Float64())
        first, entity, _ = own_executor.wait_for_ready_callbacks(10)
        looked = threading.Event()

        def run() -> None:
            looked.wait(10)
            first()

        def look() -> bool:
            looked.set()
            return False

        thread = threading.Thread(target=run)
        thread.start()
        second = own_executor.wait_for_ready_callbacks(10, condition=look)[1]
        thread.join()
        assert {entity, second} == set(node.subscriptions)


def test_a_callback_that_ends_while_the_next_of_its_group_is_put_aside_lets_that_run(
    make_node: MakeNode, context: Context
) -> None:
    class Untimely(MutuallyExclusiveCallbackGroup):
        """The callback that runs ends right after somebody has seen that it still does."""

        def can_execute(self, entity: object) -> bool:
            could = super().can_execute(entity)
            first()
            return could

    with OwnExecutor(context=context) as own_executor:
        node = make_node()
        own_executor.add_node(node)
        received: list[float] = []
        node.create_subscription(
            Float64, "x", lambda message: received.append(message.data), 10, callback_group=Untimely()
        )
        publisher = node.create_publisher(Float64, "x", 10)
        publisher.publish(Float64(data=1.0))
        publisher.publish(Float64(data=2.0))
        first = own_executor.wait_for_ready_callbacks(10)[0]
        second = own_executor.wait_for_ready_callbacks(10)[0]
        assert received == [1.0]
        second()
        assert received == [1.0, 2.0]


def test_what_blocks_on_another_thread_does_not_keep_rclpy_from_shutting_down(domain_id: int) -> None:
    rclpy.init(args=[])
    node = Node("node")
    entered, shut_down = threading.Event(), threading.Event()
    outcome: list[bool] = []

    def block() -> None:
        entered.set()
        outcome.append(shut_down.wait(10))

    node.create_guard_condition(block).trigger()
    spinning = threading.Thread(target=rclpy.spin, args=(node,))
    spinning.start()
    assert entered.wait(10)
    rclpy.shutdown()
    shut_down.set()
    spinning.join(10)
    node.destroy_node()
    assert outcome == [True]


def test_a_thousand_entities_come_and_go_under_traffic_and_nothing_is_left(
    context: Context, executor: SingleThreadedExecutor, node: Node
) -> None:
    publisher = node.create_publisher(Float64, "x", 10)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    before = threading.active_count()
    failures: list[BaseException] = []

    def churn() -> None:
        try:
            for _ in range(125):
                subscription = node.create_subscription(Float64, "x", lambda message: None, 10)
                timer = node.create_timer(0.001, lambda: None)
                publisher.publish(Float64())
                extra = node.create_publisher(Float64, "y", 10)
                node.destroy_timer(timer)
                node.destroy_subscription(subscription)
                node.destroy_publisher(extra)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=churn) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    executor.shutdown()
    spinning.join(10)
    assert not failures
    assert list(node.subscriptions) == []
    assert list(node.timers) == []
    assert node.count_subscribers("x") == 0
    assert node.count_publishers("y") == 0
    assert threading.active_count() <= before
