from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
import rclpy
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import (
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import get_default_context
from std_msgs.msg import Float64

STEADY = Clock(clock_type=ClockType.STEADY_TIME)


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Set when an executor waits: rclpy's own must not be shut down while it looks for work.

    A wait set that begins to wait keeps its guard conditions, so the end of the executor wakes it.
    """
    waits = threading.Event()

    class WaitSet(rclpy_implementation.WaitSet):  # type: ignore[misc]
        def wait(self, timeout_nsec: int) -> None:
            waits.set()
            super().wait(timeout_nsec)

    monkeypatch.setattr(rclpy_implementation, "WaitSet", WaitSet)
    return waits


def after(event: threading.Event, action: Callable[[], object]) -> threading.Thread:
    """Return a thread that waits for an event, then does something."""
    return threading.Thread(target=lambda: event.wait() and action())


def test_a_slow_callback_delays_others_by_at_most_one_call(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    order: list[str] = []

    def slow(name: str) -> Callable[[Float64], None]:
        def callback(message: Float64) -> None:
            order.append(f"{name}{message.data:.0f}")
            time.sleep(0.02)

        return callback

    publishers = []
    for name in ("left", "right"):
        node.create_subscription(Float64, name, slow(name), 10)
        publishers.append(node.create_publisher(Float64, name, 10))
    for number in range(3):
        for publisher in publishers:
            publisher.publish(Float64(data=float(number)))
    node.create_timer(0.015, lambda: order.append("timer"))
    end = Future()
    executor.spin_until_future_complete(end, timeout_sec=0.5)
    messages = [call for call in order if call != "timer"]
    assert [call[-1] for call in messages] == list("001122")  # the two subscriptions alternate
    first, last = order.index(messages[0]), order.index(messages[-1])
    assert order[first:last].count("timer") >= 2


def test_spin_once_returns_after_its_timeout(executor: SingleThreadedExecutor) -> None:
    before = STEADY.now()
    executor.spin_once(timeout_sec=0.05)
    assert (STEADY.now() - before).nanoseconds >= 50_000_000


def test_spin_once_with_timeout_zero_runs_a_ready_callback(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    triggered: list[bool] = []
    node.create_guard_condition(lambda: triggered.append(True)).trigger()
    executor.spin_once(timeout_sec=0)
    assert triggered == [True]


def test_tasks_run_before_data_and_data_in_the_order_of_creation(
    executor: SingleThreadedExecutor, node: Node, spin_until: SpinUntil
) -> None:
    order: list[str] = []
    first, second = (node.create_publisher(Float64, name, 10) for name in ("first", "second"))
    node.create_subscription(Float64, "first", lambda _: order.append("first"), 10)
    node.create_subscription(Float64, "second", lambda _: order.append("second"), 10)
    spin_until(lambda: first.get_subscription_count() and second.get_subscription_count())

    def start() -> None:
        timer.cancel()
        second.publish(Float64())
        executor.create_task(first.publish, Float64())

    timer = node.create_timer(0.0, start)
    spin_until(lambda: len(order) == 2)
    assert order == ["first", "second"]


def test_an_entity_created_on_another_thread_wakes_the_executor(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    called = threading.Event()
    spinning = threading.Thread(target=executor.spin_once)  # waits forever: the node has no entity yet
    spinning.start()
    node.create_timer(0.0, called.set)
    spinning.join(10)
    assert called.is_set()


def test_a_timer_created_in_a_callback_runs_during_the_same_spin(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    called: Future = Future()

    def create() -> None:
        first.cancel()
        node.create_timer(0.001, lambda: called.set_result(None))

    first = node.create_timer(0.001, create)
    executor.spin_until_future_complete(called, timeout_sec=5)
    assert called.done()


def test_a_subscription_destroyed_in_its_callback_is_not_called_again(
    spin_until: SpinUntil, node: Node
) -> None:
    received: list[float] = []

    def once(message: Float64) -> None:
        received.append(message.data)
        node.destroy_subscription(subscription)

    subscription = node.create_subscription(Float64, "x", once, 10)
    publisher = node.create_publisher(Float64, "x", 10)
    for number in range(3):
        publisher.publish(Float64(data=float(number)))
    spin_until(lambda: received)
    ticks: list[bool] = []
    node.create_timer(0.01, lambda: ticks.append(True))
    spin_until(lambda: len(ticks) >= 3)
    assert received == [0.0]


def test_a_flooded_subscription_does_not_starve_a_timer(spin_until: SpinUntil, node: Node) -> None:
    publisher = node.create_publisher(Float64, "x", 10)
    received = 0

    def feed_itself(message: Float64) -> None:
        nonlocal received
        received += 1
        publisher.publish(message)  # the queue is never empty

    node.create_subscription(Float64, "x", feed_itself, 10)
    ticks: list[int] = []
    node.create_timer(0.001, lambda: ticks.append(received))
    publisher.publish(Float64())
    spin_until(lambda: len(ticks) >= 20)
    assert received > len(ticks)


def test_context_shutdown_on_another_thread_ends_spin_once(
    context: Context, executor: SingleThreadedExecutor, waits: threading.Event
) -> None:
    after(waits, context.shutdown).start()
    with pytest.raises(ExternalShutdownException):
        executor.spin_once()


def test_context_shutdown_ends_a_multi_threaded_spin(context: Context, waits: threading.Event) -> None:
    with MultiThreadedExecutor(2, context=context) as executor:
        after(waits, context.shutdown).start()
        executor.spin()
    assert not context.ok()


@pytest.mark.parametrize(
    "shut_down",
    [
        rclpy.shutdown,
        rclpy.try_shutdown,
        lambda: get_default_context().shutdown(),
        lambda: get_default_context().try_shutdown(),
    ],
    ids=["shutdown", "try_shutdown", "Context.shutdown", "Context.try_shutdown"],
)
def test_rclpy_shutdown_on_another_thread_ends_rclpy_spin(
    domain_id: int, waits: threading.Event, shut_down: Callable[[], None]
) -> None:
    rclpy.init(args=[])
    node = Node("node")
    thread = after(waits, shut_down)

    def start() -> None:
        waits.clear()  # the next wait
        thread.start()

    node.create_guard_condition(start).trigger()
    with suppress(ExternalShutdownException):  # if spin looks between the ends of node and executor
        rclpy.spin(node)
    thread.join()
    node.destroy_node()
    assert not rclpy.ok()
    rclpy.try_shutdown()  # allows the next rclpy.init()


def test_executor_shutdown_on_another_thread_ends_spin(
    executor: SingleThreadedExecutor, waits: threading.Event
) -> None:
    after(waits, executor.shutdown).start()
    executor.spin()


def test_context_shutdown_ends_spin_until_future_complete(
    context: Context, executor: SingleThreadedExecutor, node: Node
) -> None:
    node.create_guard_condition(context.shutdown).trigger()
    executor.spin_until_future_complete(Future(), timeout_sec=20)
    assert not context.ok()
    executor.spin_until_future_complete(Future(), timeout_sec=20)


def test_a_callback_may_spin_its_executor(executor: SingleThreadedExecutor, node: Node) -> None:
    called: list[str] = []

    def spin() -> None:
        called.append("outer")
        inner.trigger()
        executor.spin_once(timeout_sec=5)

    inner = node.create_guard_condition(lambda: called.append("inner"), ReentrantCallbackGroup())
    node.create_guard_condition(spin).trigger()
    executor.spin_once(timeout_sec=5)
    assert called == ["outer", "inner"]


def test_callbacks_of_a_reentrant_group_overlap(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    meeting = threading.Barrier(2)
    group = ReentrantCallbackGroup()
    first = node.create_guard_condition(lambda: meeting.wait(10), group)
    second = node.create_guard_condition(lambda: meeting.wait(10), group)
    with MultiThreadedExecutor(2, context=context) as executor:
        executor.add_node(node)
        first.trigger()
        second.trigger()
        executor.spin_once(timeout_sec=5)
        executor.spin_once(timeout_sec=5)
        executor.shutdown()
    assert not meeting.broken


class BusyExecutor:
    """A multi-threaded executor whose two threads are kept busy by a subscription's callbacks."""

    def __init__(self, node: Node, executor: MultiThreadedExecutor) -> None:
        self.received: list[float] = []
        self.newest: Future = Future()
        self.release = threading.Event()
        self.executor = executor
        self._entered = threading.Semaphore(0)
        group = ReentrantCallbackGroup()
        node.create_subscription(Float64, "x", self._callback, 1, callback_group=group)
        self.publisher = node.create_publisher(Float64, "x", 1)
        executor.add_node(node)

    def _callback(self, message: Float64) -> None:
        self.received.append(message.data)
        self._entered.release()
        assert self.release.wait(20)
        if message.data == 49.0:
            self.newest.set_result(None)

    def fill(self) -> None:
        """Let each thread run a callback, with the messages 0 and 1."""
        for number in range(2):
            self.publisher.publish(Float64(data=float(number)))
            while not self._entered.acquire(blocking=False):
                self.executor.spin_once(timeout_sec=0.1)


@pytest.fixture
def busy(make_node: MakeNode, context: Context) -> Iterator[BusyExecutor]:
    with MultiThreadedExecutor(2, context=context) as executor:
        busy = BusyExecutor(make_node(), executor)
        busy.fill()
        yield busy
        busy.release.set()


def test_messages_are_taken_only_when_a_thread_is_free(busy: BusyExecutor) -> None:
    for number in range(2, 50):
        busy.publisher.publish(Float64(data=float(number)))
        busy.executor.spin_once(timeout_sec=0)
    busy.release.set()
    busy.executor.spin_until_future_complete(busy.newest, timeout_sec=20)
    assert busy.received == [0.0, 1.0, 49.0]


def test_spin_once_times_out_while_all_threads_are_busy(busy: BusyExecutor) -> None:
    busy.publisher.publish(Float64())
    before = STEADY.now()
    busy.executor.spin_once(timeout_sec=0.05)
    busy.executor.spin_once(timeout_sec=0.05)
    assert (STEADY.now() - before).nanoseconds < 10_000_000_000


@pytest.mark.parametrize(
    ("end", "messages"),
    [
        (lambda executor, future: future.set_result(None), 1),
        # With a message, rclpy's own looks for work again and again.
        (lambda executor, future: executor.context.shutdown(), 0),
        (lambda executor, future: executor.shutdown(timeout_sec=0), 0),
    ],
    ids=["future", "context", "executor"],
)
def test_spinning_ends_while_all_threads_are_busy(
    busy: BusyExecutor,
    waits: threading.Event,
    end: Callable[[MultiThreadedExecutor, Future], None],
    messages: int,
) -> None:
    future: Future = Future()
    spinning = threading.Thread(target=busy.executor.spin_until_future_complete, args=(future,))
    spinning.start()
    for _ in range(messages):
        busy.publisher.publish(Float64())
    assert waits.wait(10)
    end(busy.executor, future)
    spinning.join(10)
    assert not spinning.is_alive()


def test_every_free_thread_gets_work(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    left = threading.Semaphore(999)
    done: Future = Future()

    def callback(message: Float64) -> None:
        if not left.acquire(blocking=False):
            done.set_result(None)

    node.create_subscription(Float64, "x", callback, 1000, callback_group=ReentrantCallbackGroup())
    publisher = node.create_publisher(Float64, "x", 1000)
    for _ in range(1000):
        publisher.publish(Float64())
    with MultiThreadedExecutor(2, context=context) as executor:
        executor.add_node(node)
        executor.spin_until_future_complete(done, timeout_sec=20)
    assert done.done()
