"""Executors that are shut down or fail at critical moments."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

import rclpy
from rclpy import _executor_entities
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future, Task
from std_msgs.msg import Float64


def test_a_callback_taken_before_the_shutdown_still_runs(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    executor = MultiThreadedExecutor(2, context=context)

    class ShuttingDown(MutuallyExclusiveCallbackGroup):
        """Shuts the executor down while it takes the entity, as a signal handler may do."""

        def beginning_execution(self, entity: object) -> bool:
            executor.shutdown(timeout_sec=0)
            return super().beginning_execution(entity)

    group = ShuttingDown()
    called: list[bool] = []
    guard = node.create_guard_condition(lambda: called.append(True), group)
    executor.add_node(node)
    guard.trigger()
    executor.spin_once(timeout_sec=5)
    assert executor.shutdown(timeout_sec=10)
    assert called == [True]
    assert group.can_execute(guard)


def test_a_take_that_fails_releases_the_callback_group(
    executor: SingleThreadedExecutor, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    received: list[float] = []
    subscription = node.create_subscription(Float64, "x", lambda message: received.append(message.data), 10)
    publisher = node.create_publisher(Float64, "x", 10)

    def fail(data: bytes) -> None:
        raise ZeroDivisionError("planted")

    with monkeypatch.context() as patch:
        patch.setattr(subscription, "_rclpy_deserialize", fail)
        publisher.publish(Float64(data=1.0))
        with pytest.raises(ZeroDivisionError, match="planted"):
            executor.spin_once(timeout_sec=5)
    publisher.publish(Float64(data=2.0))
    spin_until(lambda: received)
    assert received == [2.0]


def test_a_future_of_another_thread_ends_the_wait_for_its_coroutine(user_executor: Executor) -> None:
    future: Future = Future()

    async def wait() -> Any:
        return await future

    created = user_executor.create_task(wait)
    user_executor.wait_for_ready_callbacks(10)[0]()
    thread = threading.Timer(0.05, future.set_result, [None])
    thread.start()
    user_executor.wait_for_ready_callbacks(10)[0]()
    thread.join()
    assert created.done()


def test_a_callback_ending_on_another_thread_frees_its_group(
    make_node: MakeNode, user_executor: Executor
) -> None:
    node = make_node()
    user_executor.add_node(node)
    group = MutuallyExclusiveCallbackGroup()
    began, polled = threading.Event(), threading.Event()

    def callback(message: Float64) -> None:
        began.set()
        polled.wait(10)

    node.create_subscription(Float64, "x", callback, 10, callback_group=group)
    node.create_subscription(Float64, "x", callback, 10, callback_group=group)
    node.create_publisher(Float64, "x", 10).publish(Float64())
    first, entity, _ = user_executor.wait_for_ready_callbacks(10)

    def poll() -> bool:
        polled.set()
        return False

    thread = threading.Thread(target=first)
    thread.start()
    assert began.wait(10)
    second = user_executor.wait_for_ready_callbacks(10, condition=poll)[1]
    thread.join()
    assert {entity, second} == set(node.subscriptions)


def test_a_callback_ending_during_the_check_of_the_next_frees_its_group(
    make_node: MakeNode, user_executor: Executor
) -> None:
    class EndingFirst(MutuallyExclusiveCallbackGroup):
        """Ends the running callback right after the executor has seen it run."""

        def can_execute(self, entity: object) -> bool:
            could = super().can_execute(entity)
            if running:
                future.set_result(None)
                running.pop()()
            return could

    async def callback(message: Float64) -> None:
        received.append(message.data)
        await future

    node = make_node()
    user_executor.add_node(node)
    received: list[float] = []
    running: list[Task] = []
    future = Future()
    node.create_subscription(Float64, "x", callback, 10, callback_group=EndingFirst())
    publisher = node.create_publisher(Float64, "x", 10)
    publisher.publish(Float64(data=1.0))
    publisher.publish(Float64(data=2.0))
    first = user_executor.wait_for_ready_callbacks(10)[0]
    first()
    running.append(first)
    second = user_executor.wait_for_ready_callbacks(10)[0]
    assert received == [1.0]
    second()
    assert received == [1.0, 2.0]


def test_a_blocking_callback_on_another_thread_allows_shutdown(domain_id: int) -> None:
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


def test_spinning_once_again_runs_the_next_task_without_waiting(executor: SingleThreadedExecutor) -> None:
    order: list[int] = []
    for number in range(4):
        executor.create_task(order.append, number)
        executor.spin_once(timeout_sec=0)
        assert order == [*range(number + 1)]


@pytest.mark.parametrize(("break_", "waits", "looks"), [(10**12, 1, 6), (-1, 5, 5)])
def test_a_reader_is_asked_again_only_in_a_flood(
    executor: SingleThreadedExecutor,
    monkeypatch: pytest.MonkeyPatch,
    node: Node,
    break_: int,
    waits: int,
    looks: int,
) -> None:
    monkeypatch.setattr(_executor_entities, "_BURST", 10**12)
    monkeypatch.setattr(_executor_entities, "_BREAK", break_)  # ns: each break is shorter, or longer
    received: list[float] = []
    subscription = node.create_subscription(Float64, "x", lambda message: received.append(message.data), 10)
    publisher = node.create_publisher(Float64, "x", 10)
    executor.spin_once(timeout_sec=0)  # takes the reader into the wait set
    calls = Counter[str]()

    def counted(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def count(*arguments: Any) -> Any:
            calls[name] += 1
            return call(*arguments)

        return count

    monkeypatch.setattr(executor._rclpy_waitset, "wait", counted("waits", executor._rclpy_waitset.wait))
    monkeypatch.setattr(subscription, "_rclpy_take", counted("looks", subscription._rclpy_take))
    for number in range(5):
        publisher.publish(Float64(data=float(number)))
    while len(received) < 5:
        executor.spin_once(timeout_sec=5)
    monkeypatch.setattr(executor._rclpy_waitset, "wait", lambda timeout: [])
    executor.spin_once(timeout_sec=0)  # ends the burst

    assert received == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert (calls["waits"], calls["looks"]) == (waits, looks)


def test_a_callback_that_spins_leaves_the_end_of_the_outer_spinning_to_it(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    wanted: Future = Future()
    other: Future = Future()
    group = ReentrantCallbackGroup()

    def spin_again() -> None:
        first.cancel()
        executor.spin_until_future_complete(other, timeout_sec=5)

    def complete_wanted() -> None:
        second.cancel()
        wanted.set_result(None)

    def complete_other() -> None:
        third.cancel()
        other.set_result(None)

    first = node.create_timer(0.001, spin_again, group)
    second = node.create_timer(0.01, complete_wanted, group)
    third = node.create_timer(0.05, complete_other, group)
    began = time.monotonic()
    executor.spin_until_future_complete(wanted, timeout_sec=20)
    assert other.done()
    assert time.monotonic() - began < 10  # not by the timeout


@pytest.mark.timeout(20)
def test_spin_once_ends_at_its_timeout_while_ready_data_cannot_be_taken(
    executor: SingleThreadedExecutor, monkeypatch: pytest.MonkeyPatch, node: Node
) -> None:
    subscription = node.create_subscription(Float64, "x", lambda _: None, 10)
    looks: list[None] = []
    monkeypatch.setattr(subscription, "_rclpy_take", lambda: looks.append(None))
    node.create_publisher(Float64, "x", 10).publish(Float64())
    executor.spin_once(timeout_sec=0.05)
    assert looks


def test_after_a_shutdown_in_a_callback_no_other_callback_runs(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    called: list[int] = []

    def call(number: int) -> None:
        called.append(number)
        executor.shutdown(timeout_sec=0)

    for number in range(2):
        node.create_guard_condition(lambda number=number: call(number)).trigger()
    executor.spin()
    assert called == [0]


def test_spin_calls_the_spin_once_of_a_subclass(context: Context, make_node: MakeNode) -> None:
    class Counting(SingleThreadedExecutor):
        turns = 0

        def spin_once(self, timeout_sec: float | None = None) -> None:
            self.turns += 1
            super().spin_once(timeout_sec)

    node = make_node()
    with Counting(context=context) as executor:
        guards: list[bool] = []

        def on_guard() -> None:
            guards.append(True)
            if len(guards) == 2:
                executor.shutdown(timeout_sec=0)
            else:
                guard.trigger()

        guard = node.create_guard_condition(on_guard)
        executor.add_node(node)
        guard.trigger()
        executor.spin()

    assert (len(guards), executor.turns) == (2, 2)


def test_shutdown_by_a_signal_handler_may_interrupt_the_pool(
    make_node: MakeNode, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    executor = MultiThreadedExecutor(2, context=context)
    start_thread = executor._rclpy_pool._adjust_thread_count

    def interrupted() -> None:  # while the pool holds its lock
        assert executor.shutdown()
        start_thread()

    monkeypatch.setattr(executor._rclpy_pool, "_adjust_thread_count", interrupted)
    called = threading.Event()
    guard = node.create_guard_condition(called.set)
    executor.add_node(node)
    guard.trigger()

    executor.spin_once(timeout_sec=5)

    assert called.wait(10)
    assert executor._rclpy_pool._shutdown
