"""The faults of ROS 2's EventsExecutor, which the executor of services has not.

A test of `rclpys_own` fails when a newer rclpy has mended that fault: then the work-around can go.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.task import Future
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from reactive_node import ReactiveNode
from reactive_node.executor import create_executor
from reactive_node.sampled_reader import Polled
from reactive_node.testing import MakeNode, SpinUntil

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ONE = Float64(data=1.0)

OF_RCLPY = pytest.mark.skipif(
    bool(os.environ.get("RCLPY_GROUND")), reason="platform: rclpy_ground has an EventsExecutor of its own"
)
"""Faults of rclpy's own EventsExecutor, which our executor works around."""


class Planted(Exception):
    """An error of a callback."""


def fail(*_: object) -> None:
    raise Planted


@pytest.fixture
def executor(context: Context) -> Any:
    with create_executor(context) as executor:
        yield executor


@pytest.fixture
def fault(context: Context) -> Any:
    with EventsExecutor(context=context) as executor:
        yield executor


def program(body: str) -> subprocess.Popen[str]:
    """Run a program with a node, an executor of rclpy and ours."""
    head = """
import rclpy, signal, sys, time
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from reactive_node.executor import create_executor
from std_msgs.msg import Float64
rclpy.init()
node = rclpy.create_node("node")
def fail(*_): raise LookupError("planted")
"""
    return subprocess.Popen(
        [sys.executable, "-c", head + body], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


# An endless wait


SPIN = """
node.create_timer(0.01, lambda: print("ticks", flush=True))
executor = {}
executor.add_node(node)
print("spins", flush=True)
try:
    executor.spin()
except (ExternalShutdownException, KeyboardInterrupt):
    print("ended")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_spin_calls_timers_and_ends_on_a_signal(domain_id: int, number: int) -> None:
    process = program(SPIN.format("create_executor()"))
    assert process.stdout is not None
    lines = [process.stdout.readline().strip() for _ in range(4)]
    assert lines == ["spins", "ticks", "ticks", "ticks"]
    process.send_signal(number)
    output, errors = process.communicate(timeout=150.0)
    assert "ended" in output, errors


@OF_RCLPY
def test_spin_of_rclpys_own_is_a_busy_loop(domain_id: int) -> None:
    process = program(
        "executor = EventsExecutor(); executor.add_node(node); print('spins', flush=True); executor.spin()"
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "spins"
    clock = ~process.pid << 3 | 2  # of its processor time: clock_getcpuclockid(3)
    enough, deadline = time.clock_gettime(clock) + 0.5, time.monotonic() + 10.0
    try:
        while time.clock_gettime(clock) < enough:
            assert time.monotonic() < deadline, "it does not wait busily any more"
            time.sleep(0.05)
    finally:
        process.kill()
        process.communicate(timeout=150.0)


def test_spin_once_without_limit_waits_for_a_callback(make_node: MakeNode, executor: Executor) -> None:
    called: list[float] = []
    node = make_node()
    node.create_timer(0.05, lambda: called.append(time.monotonic()))
    deadline = time.monotonic() + 10.0
    while not called:  # adding the node is no callback
        executor.spin_once()
        assert time.monotonic() < deadline
    assert called


def test_end_of_the_context_on_another_thread_ends_spin(
    context: Context, make_node: MakeNode, executor: Executor
) -> None:
    make_node()
    timer = threading.Timer(0.1, context.try_shutdown)
    timer.start()
    with pytest.raises(ExternalShutdownException):
        executor.spin()
    timer.join()


def test_shutdown_on_another_thread_ends_spin(make_node: MakeNode, executor: Executor) -> None:
    make_node()
    timer = threading.Timer(0.1, executor.shutdown)
    timer.start()
    executor.spin()
    timer.join()


def test_turns_leave_nothing_in_their_future(executor: Executor) -> None:
    future: Future[None] = Future()
    for _ in range(3):
        executor.spin_until_future_complete(future, timeout_sec=0.0)
        executor.spin_once_until_future_complete(future, timeout_sec=0.0)
    assert future._callbacks == []


@OF_RCLPY
def test_turns_of_rclpys_own_leave_a_block_behind(make_node: MakeNode, context: Context) -> None:
    with EventsExecutor(context=context) as fault:
        before = sys.getallocatedblocks()
        for _ in range(1000):
            fault.spin_until_future_complete(Future(), timeout_sec=0.0)
        assert sys.getallocatedblocks() - before > 900


def test_task_that_waits_is_no_busy_loop(executor: Executor) -> None:
    async def wait() -> None:
        await Future()

    executor.create_task(wait)
    begin = time.process_time()
    executor.spin_until_future_complete(Future(), timeout_sec=0.5)
    assert time.process_time() - begin < 0.25


def test_task_may_wait_for_a_later_one(executor: Executor) -> None:
    async def wait(other: list[Future[str]]) -> str:
        return await other[0]

    other: list[Future[str]] = []
    task = executor.create_task(wait, other)
    other.append(executor.create_task(lambda: "later"))
    begin = time.monotonic()
    executor.spin_until_future_complete(task, timeout_sec=10.0)
    assert task.result() == "later"
    assert time.monotonic() - begin < 0.2, "it came with the next turn only"


# The info of a message


@pytest.mark.parametrize("raw", [False, True])
def test_callback_gets_the_info_of_a_message(make_node: MakeNode, spin_until: SpinUntil, raw: bool) -> None:
    node = make_node()
    received: list[tuple[Any, Any]] = []
    node.create_subscription(Float64, "topic", lambda m, info: received.append((m, info)), LATCHED, raw=raw)
    before = time.time_ns()
    node.create_publisher(Float64, "topic", LATCHED).publish(ONE)
    spin_until(lambda: received)
    ((message, info),) = received
    assert message == (serialize_message(ONE) if raw else ONE)
    assert before <= info["source_timestamp"] <= time.time_ns()


def test_callback_may_be_replaced_by_one_that_takes_the_info(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    node = make_node()
    received: list[Any] = []
    subscription = node.create_subscription(Float64, "topic", received.append, 10)
    publisher = node.create_publisher(Float64, "topic", 10)
    publisher.publish(ONE)
    spin_until(lambda: len(received) == 1)
    subscription.callback = lambda message, info: received.append(info["source_timestamp"])
    publisher.publish(ONE)
    spin_until(lambda: len(received) == 2)
    assert received[0] == ONE
    assert isinstance(received[1], int)


@OF_RCLPY
def test_rclpys_own_refuses_a_callback_that_takes_the_info(context: Context, fault: Executor) -> None:
    node = Node("node", context=context)
    fault.add_node(node)
    node.create_subscription(Float64, "topic", lambda message, info: None, LATCHED)
    node.create_publisher(Float64, "topic", LATCHED).publish(ONE)
    with pytest.raises(SystemError, match="null argument"):
        fault.spin_until_future_complete(Future(), timeout_sec=5.0)
    node.destroy_node()


# Errors


def _publish(node: Node) -> None:
    node.create_subscription(Float64, "topic", fail, LATCHED)
    node.create_publisher(Float64, "topic", LATCHED).publish(ONE)


def _tick(node: Node) -> None:
    node.create_timer(0.01, fail)


def _match(node: Node) -> None:
    node.create_publisher(Float64, "topic", 10, event_callbacks=PublisherEventCallbacks(matched=fail))
    node.create_subscription(Float64, "topic", fail, 10)


def _call(node: Node) -> None:
    node.create_service(Trigger, "service", fail)
    node.create_client(Trigger, "service").call_async(Trigger.Request())


def _task(node: Node) -> None:
    assert node.executor is not None
    node.executor.create_task(fail)


@pytest.mark.parametrize("cause", [_publish, _tick, _match, _call, _task])
def test_error_of_a_callback_comes_out_of_spinning(
    make_node: MakeNode, executor: Executor, capfd: pytest.CaptureFixture[str], cause: Callable[[Node], None]
) -> None:
    node = make_node()
    cause(node)
    with pytest.raises(Planted):
        executor.spin_until_future_complete(Future(), timeout_sec=10.0)
    if cause not in (_match, _task):  # rclpy logs those errors itself
        assert not capfd.readouterr().err


@OF_RCLPY
def test_error_of_a_task_kills_rclpys_own(domain_id: int) -> None:
    process = program(
        "executor = EventsExecutor(); executor.add_node(node)\n"
        "executor.create_task(fail); executor.spin_once(timeout_sec=5.0)"
    )
    process.communicate(timeout=150.0)
    assert process.returncode == -signal.SIGSEGV


# Coroutines


def test_callbacks_may_be_coroutines(make_node: MakeNode, executor: Executor, spin_until: SpinUntil) -> None:
    node = make_node()
    go: Future[None] = Future()
    received: list[Any] = []

    async def receive(message: Float64) -> None:
        await go
        received.append(message)

    async def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        await go
        response.message = "answer"
        return response

    node.create_subscription(Float64, "topic", receive, LATCHED)
    node.create_publisher(Float64, "topic", LATCHED).publish(ONE)
    node.create_service(Trigger, "service", serve)
    answer = node.create_client(Trigger, "service").call_async(Trigger.Request())
    timer = threading.Timer(0.3, lambda: (go.set_result(None), executor.wake()))
    timer.start()
    executor.spin_until_future_complete(answer, timeout_sec=10.0)
    assert answer.result().message == "answer"
    spin_until(lambda: received == [ONE])
    timer.join()


# Callback groups and guard conditions


def test_polled_reader_is_not_read(make_node: MakeNode, spin_until: SpinUntil) -> None:
    node = make_node()
    received: list[str] = []
    for name, group in (("polled", Polled()), ("other", None)):
        node.create_subscription(
            Float64, "topic", lambda _, name=name: received.append(name), LATCHED, callback_group=group
        )
    publisher = node.create_publisher(Float64, "topic", LATCHED)
    publisher.publish(ONE)
    spin_until(lambda: received)
    publisher.publish(ONE)
    spin_until(lambda: len(received) == 2)
    assert received == ["other", "other"]


@OF_RCLPY
def test_guard_condition_is_refused(make_node: MakeNode, executor: Executor) -> None:
    make_node().create_guard_condition(lambda: None)
    with pytest.raises(RuntimeError, match="Guard conditions not supported"):
        executor.spin_once(timeout_sec=1.0)


# Entities that come and go


def test_timer_may_change_itself_in_its_callback(make_node: MakeNode, spin_until: SpinUntil) -> None:
    node = make_node()
    calls: list[str] = []

    def again() -> None:
        calls.append("again")
        timers[0].timer_period_ns = 1_000_000
        timers[0].reset()

    def cancel() -> None:
        calls.append("cancel")
        timers[1].cancel()

    def destroy() -> None:
        calls.append("destroy")
        node.destroy_timer(timers[2])

    timers = [node.create_timer(0.01, callback) for callback in (again, cancel, destroy)]
    spin_until(lambda: calls.count("again") == 50)
    assert (calls.count("cancel"), calls.count("destroy")) == (1, 1)
    timers[1].reset()
    spin_until(lambda: calls.count("cancel") == 2)


def test_timer_of_another_thread_wakes_a_sleeping_executor(make_node: MakeNode, executor: Executor) -> None:
    node = make_node()
    called: Future[None] = Future()
    timer = threading.Timer(0.2, lambda: node.create_timer(0.01, lambda: called.set_result(None)))
    timer.start()
    executor.spin_until_future_complete(called, timeout_sec=10.0)
    assert called.done()
    timer.join()


def test_destroyed_subscription_gets_no_waiting_message(make_node: MakeNode, spin_until: SpinUntil) -> None:
    node = make_node()
    received: list[str] = []

    def receive_once(message: Float64) -> None:
        received.append("destroyed")
        node.destroy_subscription(destroyed)

    many = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    destroyed = node.create_subscription(Float64, "topic", receive_once, many)
    node.create_subscription(Float64, "topic", lambda _: received.append("other"), many)
    publisher = node.create_publisher(Float64, "topic", many)
    for _ in range(5):
        publisher.publish(ONE)
    spin_until(lambda: received.count("other") == 5 and "destroyed" in received)
    publisher.publish(ONE)
    spin_until(lambda: received.count("other") == 6)
    assert received.count("destroyed") == 1


def test_entities_come_and_go_a_thousand_times_under_traffic(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    node, peer = make_node(), make_node("peer")
    publisher = peer.create_publisher(Float64, "topic", 10)
    peer.create_timer(0.0005, lambda: publisher.publish(ONE))
    rounds: list[None] = []
    alive: list[Any] = []

    def change() -> None:
        rounds.append(None)
        for kind, entity in alive:
            getattr(node, f"destroy_{kind}")(entity)
        events = PublisherEventCallbacks(matched=lambda _: None)
        alive[:] = [
            ("subscription", node.create_subscription(Float64, "topic", lambda _: None, 10)),
            ("publisher", node.create_publisher(Float64, "topic", 10, event_callbacks=events)),
            ("timer", node.create_timer(0.0005, lambda: None)),
        ]

    node.create_timer(0.001, change)
    spin_until(lambda: len(rounds) >= 1000, 60.0)


def test_nodes_are_those_that_were_added(make_node: MakeNode, executor: Executor) -> None:
    node = make_node(kind=ReactiveNode)
    assert executor.get_nodes() == [node]
    assert node.executor is executor
    assert not executor.add_node(node)
    executor.remove_node(node)
    assert executor.get_nodes() == []
