"""Thousands of entities are created and destroyed under traffic, on several threads, without leaks."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
from deploy.runtime.tests.host import wait_until
from deploy.runtime.tests.nodes import MakeNode

from rclpy._dds.library import blocking
from rclpy.context import Context
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

CYCLES = 1000
WARM_UP = 400  # cycles
THREADS = 4
MEMORY = 8.0  # MB that a process may grow; a leaked reader or writer per cycle costs about 20
SECONDS = 30.0


def memory() -> float:
    """Resident memory of this process [MB]."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def lasting_threads() -> int:
    """Number of threads, without those of an executor's pool: it grows to its size when it needs to."""
    return sum(not thread.name.startswith("rclpy-executor") for thread in threading.enumerate())


def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
    response.success = request.data
    return response


def endpoints(node: Node) -> tuple[int, int, int]:
    """Numbers of publishers and subscriptions of the flood, and of topics of any kind."""
    topics = node.get_topic_names_and_types(no_demangle=True)
    return node.count_publishers("flood"), node.count_subscribers("flood"), len(topics)


def churn(node: Node, cycles: int, failures: list[BaseException]) -> None:
    try:
        for number in range(cycles):
            name = f"s{threading.get_ident()}"
            subscription = node.create_subscription(Float64, "flood", lambda message: None, 10)
            publisher = node.create_publisher(Float64, "flood", 10)
            timer = node.create_timer(0.0005, lambda: None)
            service = node.create_service(SetBool, name, answer)
            client = node.create_client(SetBool, name)
            publisher.publish(Float64())
            future = client.call_async(SetBool.Request(data=True))
            if number % 2:
                future.cancel()
            node.destroy_timer(timer)
            node.destroy_client(client)
            node.destroy_service(service)
            node.destroy_publisher(publisher)
            node.destroy_subscription(subscription)
    except BaseException as error:
        failures.append(error)


@dataclass
class Flood:
    """A node under traffic: another participant publishes on ``flood`` continuously."""

    node: Node
    other: Node
    executor: Executor
    failures: list[BaseException]


@pytest.fixture
def other(other_context: Context) -> Iterator[Node]:
    node = Node("flooding", context=other_context)
    yield node
    node.destroy_node()


@pytest.fixture(params=[SingleThreadedExecutor, partial(MultiThreadedExecutor, 2)], ids=["single", "multi"])
def flood(
    request: pytest.FixtureRequest, make_node: MakeNode, context: Context, other: Node
) -> Iterator[Flood]:
    flood = Flood(make_node("churned"), other, request.param(context=context), [])
    flood.executor.add_node(flood.node)
    publisher = other.create_publisher(Float64, "flood", 10)
    end = threading.Event()

    def spin() -> None:
        try:
            flood.executor.spin()
        except BaseException as error:
            flood.failures.append(error)

    def pour() -> None:
        with SingleThreadedExecutor(context=other.context) as executor:
            executor.add_node(other)
            while not end.wait(0.0005):
                publisher.publish(Float64())
                executor.spin_once(timeout_sec=0)

    background = [threading.Thread(target=work) for work in (spin, pour)]
    for thread in background:
        thread.start()
    yield flood
    end.set()
    ended = flood.executor.shutdown(SECONDS)
    for thread in background:
        thread.join(SECONDS)
    assert ended
    assert not flood.failures


@pytest.mark.timeout(180)
def test_a_thousand_entities_of_each_kind_leave_nothing_behind(flood: Flood, context: Context) -> None:
    node, other = flood.node, flood.other

    def wait_for(condition: Callable[[], object]) -> None:
        assert node._rclpy_graph.wait_for(lambda: bool(condition()), SECONDS, context.ok)

    def run(cycles: int) -> None:
        threads = [
            threading.Thread(target=churn, args=(node, cycles // THREADS, flood.failures))
            for _ in range(THREADS)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    wait_for(lambda: node.count_publishers("flood"))
    wait_for(lambda: endpoints(other) == endpoints(node))
    before = endpoints(node)
    run(WARM_UP)  # every pool reaches its size
    wait_for(lambda: endpoints(node) == endpoints(other) == before)
    size, threads = memory(), lasting_threads()
    run(CYCLES)
    assert not flood.failures
    assert lasting_threads() <= threads
    wait_for(lambda: endpoints(node) == endpoints(other) == before)
    assert memory() - size < MEMORY
    assert [*node.subscriptions, *node.timers, *node.clients] == []

    # Waiting threads are still woken.
    received = threading.Event()
    node.create_subscription(Float64, "flood", lambda message: received.set(), 10)
    assert received.wait(SECONDS)
    node.create_service(SetBool, "last", answer)
    client = node.create_client(SetBool, "last")
    assert client.wait_for_service(SECONDS)
    assert client.call(SetBool.Request(data=True), SECONDS) == SetBool.Response(success=True)


@pytest.mark.parametrize("queries", [False, True])
def test_a_node_that_never_spins_keeps_no_announcements_of_peers(
    make_node: MakeNode, other: Node, queries: bool
) -> None:
    node = make_node("deaf")
    if queries:
        assert node.wait_for_node("flooding", SECONDS)
    for _ in range(CYCLES):
        other.destroy_publisher(other.create_publisher(Float64, "flood", 10))
    graph = node._rclpy_graph
    held = [graph._peers._reader.condition, *(graph._discovery.gone if graph._discovery else ())]
    # DDS holds no sample that was never taken
    wait_until(lambda: not any(blocking.dds_triggered(condition) for condition in held), SECONDS)


def test_shutdown_wakes_threads_that_begin_to_wait_meanwhile() -> None:
    def begin(context: Context, events: list[threading.Event], under_way: threading.Event) -> None:
        for number in range(2000):
            events.append(threading.Event())
            context._rclpy_wake_on_shutdown(events[-1])
            if number == 1000:
                under_way.set()

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for _ in range(20):
            context = Context()
            context.init(args=[])
            events: list[threading.Event] = []
            under_way = threading.Event()
            beginning = threading.Thread(target=begin, args=(context, events, under_way))
            beginning.start()
            assert under_way.wait(SECONDS)
            context.shutdown()
            beginning.join()
            assert all(event.is_set() for event in events)
    finally:
        sys.setswitchinterval(interval)
