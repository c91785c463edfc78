from __future__ import annotations

import asyncio
import threading
import weakref
from typing import Any

import pytest
import reactivex as rx
from rclpy.node import Node
from reactivex.notification import OnError
from reactivex.scheduler import ImmediateScheduler, ThreadPoolScheduler
from reactivex.subject import Subject
from reactivex.testing import ReactiveTest
from std_msgs.msg import Int64

from reactive_node import ReactiveNode, latest
from reactive_node.testing import SpinFor, SpinUntil, VirtualTime

on_next, on_error, on_completed = ReactiveTest.on_next, ReactiveTest.on_error, ReactiveTest.on_completed
subscribe = ReactiveTest.subscribe
WORK = 2.0  # [s]
PLANTED = ValueError("planted")


class Work:
    """Returns each item in upper case, and keeps a list of them."""

    def __init__(self) -> None:
        self.items: list[str] = []

    def __call__(self, item: str) -> str:
        self.items.append(item)
        if item == "bad":
            raise PLANTED
        return item.upper()


@pytest.fixture
def work() -> Work:
    return Work()


# In virtual time


@pytest.mark.parametrize(
    ("items", "messages", "worked", "end"),
    [
        pytest.param(
            [on_next(1, "a"), on_next(3, "b"), on_next(7, "c")],
            [on_next(3, "A"), on_next(5, "B"), on_next(9, "C")],
            ["a", "b", "c"],
            30,
            id="time for each item",
        ),
        pytest.param(
            [on_next(at, item) for at, item in zip((1, 1.5, 2, 2.5, 4, 20), "abcdef", strict=True)],
            [on_next(3, "A"), on_next(5, "D"), on_next(7, "E"), on_next(22, "F")],
            ["a", "d", "e", "f"],
            30,
            id="the newest item replaces those that wait",
        ),
        pytest.param(
            [on_next(1, "a"), on_next(1.5, "b"), on_next(2, "c"), on_completed(2.5)],
            [on_next(3, "A"), on_next(5, "C"), on_completed(5)],
            ["a", "c"],
            2.5,
            id="completion waits for work and the newest item",
        ),
        pytest.param(
            [on_next(1, "a"), on_completed(4)],
            [on_next(3, "A"), on_completed(4)],
            ["a"],
            4,
            id="completion of an idle source",
        ),
        pytest.param(
            [on_next(1, "bad"), on_next(2, "b"), on_next(4, "c")],
            [on_error(3, PLANTED)],
            ["bad"],
            3,
            id="error of the work",
        ),
        pytest.param(
            [on_next(1, "a"), on_next(1.5, "b"), on_error(2, PLANTED)],
            [on_error(2, PLANTED)],
            [],  # the worker's actions take effect when they end
            2,
            id="error of the source",
        ),
    ],
)
def test_items_are_worked_on_until_an_end(
    scheduler: VirtualTime, work: Work, items: list[Any], messages: list[Any], worked: list[str], end: float
) -> None:
    source = scheduler.create_hot_observable(*items)

    recording = scheduler.record(source.pipe(latest(work, scheduler.worker(WORK))), until=30)

    assert recording.messages == messages
    assert work.items == worked
    assert source.subscriptions == [subscribe(0, end)]


def test_none_is_an_item(scheduler: VirtualTime) -> None:
    items = scheduler.hot((1, "a"), (2, None))

    recording = scheduler.record(items.pipe(latest(repr, scheduler.worker(WORK))), until=10)

    assert recording.items == [(3, "'a'"), (5, "None")]


@pytest.mark.parametrize("kind", [asyncio.CancelledError, SystemExit, KeyboardInterrupt])
def test_exit_of_work_is_error_of_observable(scheduler: VirtualTime, kind: type[BaseException]) -> None:
    planted = kind("planted")

    def work(_: str) -> str:
        raise planted

    recording = scheduler.record(scheduler.hot((1, "a")).pipe(latest(work, scheduler.worker(WORK))), until=10)

    (message,) = recording.messages
    assert message.time == 3
    assert isinstance(message.value, OnError)
    assert isinstance(message.value.exception, RuntimeError)
    assert message.value.exception.__cause__ is planted


def test_disposing_begins_no_work_any_more(scheduler: VirtualTime, work: Work) -> None:
    items = scheduler.hot((1, "a"), (2, "b"), (3.5, "c"))

    recording = scheduler.record(items.pipe(latest(work, scheduler.worker(WORK))), until=4)
    scheduler.advance_to(10)

    assert recording.messages == [on_next(3, "A")]
    assert work.items == ["a"]
    assert items.subscriptions == [subscribe(0, 4)]


def test_observer_that_leaves_with_result_begins_no_work(scheduler: VirtualTime, work: Work) -> None:
    items = scheduler.hot((1, "a"), (2, "b"))

    recording = scheduler.record(items.pipe(latest(work, scheduler.worker(WORK))).take(1), until=10)

    assert recording.messages == [on_next(3, "A"), on_completed(3)]
    assert work.items == ["a"]


def test_each_subscription_works_for_itself(scheduler: VirtualTime, work: Work) -> None:
    results = scheduler.hot((1, "a"), (2, "b")).pipe(latest(work, scheduler.worker(WORK)))

    recording = scheduler.record(rx.merge(results, results), until=10)

    assert recording.items == [(3, "A"), (3, "A"), (5, "B"), (5, "B")]


def test_subscription_without_scheduler_is_error(scheduler: VirtualTime, work: Work) -> None:
    errors: list[Exception] = []

    scheduler.hot().pipe(latest(work, scheduler.worker(WORK))).subscribe(on_error=errors.append)

    assert "scheduler=node.scheduler" in str(errors[0])


# With threads


class Gate:
    """Work on a thread of its own that waits until it is let through."""

    def __init__(self) -> None:
        self.began = threading.Event()
        self.opened = threading.Event()
        self.threads: set[int] = set()

    def __call__(self, item: Any) -> Any:
        self.threads.add(threading.get_ident())
        self.began.set()
        assert self.opened.wait(30)
        return item


@pytest.fixture
def gate() -> Any:
    gate = Gate()
    yield gate
    gate.opened.set()


@pytest.fixture
def pool() -> Any:
    pool = ThreadPoolScheduler(1)
    yield pool
    pool.executor.shutdown()


def test_node_goes_on_while_work_runs_on_another_thread(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil, gate: Gate, pool: ThreadPoolScheduler
) -> None:
    results: list[tuple[int, int]] = []
    ticks: list[int] = []
    numbers = node.create_observable(Int64, "numbers").map(lambda message: message.data)
    numbers.pipe(latest(gate, pool)).subscribe(
        lambda number: results.append((number, threading.get_ident())), scheduler=node.scheduler
    )
    received: list[int] = []
    numbers.subscribe(received.append, scheduler=node.scheduler)
    publisher = peer.create_publisher(Int64, "numbers", 10)
    spin_until(lambda: publisher.get_subscription_count() == 1)

    publisher.publish(Int64(data=1))
    spin_until(gate.began.is_set)
    rx.interval(0.001).subscribe(ticks.append, scheduler=node.scheduler)
    for number in (2, 3, 4):
        publisher.publish(Int64(data=number))
    spin_until(lambda: len(ticks) >= 3 and received == [1, 2, 3, 4])
    assert results == []
    gate.opened.set()
    spin_until(lambda: len(results) == 2)

    here = threading.get_ident()
    assert results == [(1, here), (4, here)]
    assert here not in gate.threads


def test_disposing_loses_result_of_running_work(
    node: ReactiveNode, spin_for: SpinFor, gate: Gate, pool: ThreadPoolScheduler
) -> None:
    results: list[int] = []
    numbers: Subject[int] = Subject()
    subscription = numbers.pipe(latest(gate, pool)).subscribe(results.append, scheduler=node.scheduler)

    numbers.on_next(1)
    numbers.on_next(2)
    assert gate.began.wait(10)
    subscription.dispose()
    gate.opened.set()
    pool.executor.shutdown()
    spin_for(0.05)

    assert results == []


def test_unobserved_error_of_work_is_raised_by_spin(
    node: ReactiveNode, spin_until: SpinUntil, pool: ThreadPoolScheduler
) -> None:
    numbers: Subject[int] = Subject()
    node.publish_observable(numbers.pipe(latest(lambda number: 1 / number, pool)), Int64, "inverses")

    numbers.on_next(0)

    with pytest.raises(ZeroDivisionError):
        spin_until(lambda: False)


# A flood


class Item:
    def __init__(self, value: int) -> None:
        self.value = value


def test_flood_keeps_two_items_alive(
    node: ReactiveNode, spin_until: SpinUntil, gate: Gate, pool: ThreadPoolScheduler
) -> None:
    alive: weakref.WeakSet[Item] = weakref.WeakSet()
    results: list[int] = []
    items: Subject[Item] = Subject()
    items.pipe(latest(gate, pool)).subscribe(
        lambda item: results.append(item.value), scheduler=node.scheduler
    )

    most = 0
    for value in range(10_000):
        item = Item(value)
        alive.add(item)
        items.on_next(item)
        del item
        most = max(most, len(alive))
    gate.opened.set()
    spin_until(lambda: len(results) == 2)

    assert results == [0, 9_999]
    assert most == 2


def test_quick_work_does_not_pile_up_results(node: ReactiveNode, spin_until: SpinUntil, work: Work) -> None:
    results: list[str] = []
    items: Subject[str] = Subject()
    items.pipe(latest(work, ImmediateScheduler())).subscribe(results.append, scheduler=node.scheduler)

    for number in range(100):  # while the executor is busy elsewhere
        items.on_next(f"item {number}")
    assert work.items == ["item 0"]
    spin_until(lambda: len(results) == 2)

    assert results == ["ITEM 0", "ITEM 99"]
