"""Executors of users: what they get from ``wait_for_ready_callbacks()``, and methods that they override."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, subscribe

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.node import Node
from rclpy.task import Future, Task


@pytest.fixture
def node(make_node: MakeNode, user_executor: Executor) -> Node:
    node = make_node()
    user_executor.add_node(node)
    return node


def run_all(executor: Executor, until: Callable[[], object]) -> None:
    while not until():
        executor.wait_for_ready_callbacks(10)[0]()


def test_a_created_task_is_returned_itself_without_entity_and_node(user_executor: Executor) -> None:
    created = user_executor.create_task(lambda: 7)
    assert user_executor.wait_for_ready_callbacks(10) == (created, None, None)
    created()
    assert created.result() == 7
    with pytest.raises(TimeoutException):
        user_executor.wait_for_ready_callbacks(0)


def test_a_created_coroutine_is_returned_again_after_its_wait(user_executor: Executor) -> None:
    future: Future = Future()

    async def wait() -> Any:
        return await future

    created = user_executor.create_task(wait)
    user_executor.wait_for_ready_callbacks(10)[0]()
    assert not created.done()
    future.set_result("done")
    run_all(user_executor, created.done)
    assert created.result() == "done"


def test_a_callback_that_goes_on_has_its_entity_and_node_again(user_executor: Executor, node: Node) -> None:
    future: Future = Future()

    async def callback() -> None:
        timer.cancel()
        await future

    timer = node.create_timer(0.0, callback)
    task, entity, of = user_executor.wait_for_ready_callbacks(10)
    assert (entity, of) == (timer, node)
    task()
    future.set_result(None)
    assert user_executor.wait_for_ready_callbacks(10) == (task, timer, node)
    task()
    assert task.done()


def test_a_callback_that_was_not_run_is_returned_again(user_executor: Executor, node: Node) -> None:
    received, publish = subscribe(node)
    publish(5.0)
    postponed = user_executor.wait_for_ready_callbacks(10)
    assert user_executor.wait_for_ready_callbacks(10) == postponed
    postponed[0]()
    assert received == [5.0]
    with pytest.raises(TimeoutException):
        user_executor.wait_for_ready_callbacks(0)


def test_a_callback_that_was_not_run_delays_no_other(user_executor: Executor, node: Node) -> None:
    _, publish_postponed = subscribe(node, "postponed")
    publish_postponed(1.0)
    postponed = user_executor.wait_for_ready_callbacks(10)[0]
    received, publish = subscribe(node, "other")
    publish(2.0)
    while not received:
        task = user_executor.wait_for_ready_callbacks(10)[0]
        if task is not postponed:
            task()
    assert received == [2.0]
    postponed()


def test_an_entity_cannot_execute_between_its_return_and_its_run(user_executor: Executor, node: Node) -> None:
    _, publish = subscribe(node, callback_group=ReentrantCallbackGroup())
    publish(1.0)
    task, entity, _ = user_executor.wait_for_ready_callbacks(10)
    assert not user_executor.can_execute(entity)
    task()
    assert user_executor.can_execute(entity)


def test_a_callback_whose_group_is_busy_keeps_its_message(user_executor: Executor, node: Node) -> None:
    group, future = MutuallyExclusiveCallbackGroup(), Future()

    async def callback() -> None:
        timer.cancel()
        await future

    timer = node.create_timer(0.0, callback, group)
    received, publish = subscribe(node, callback_group=group)
    running = user_executor.wait_for_ready_callbacks(10)[0]
    publish(1.0)
    running()
    with suppress(TimeoutException):
        while True:  # the callback begins without work, or is not offered
            user_executor.wait_for_ready_callbacks(0.05)[0]()
    assert received == []
    future.set_result(None)
    run_all(user_executor, lambda: received)
    assert received == [1.0]


def test_a_pool_of_a_user_gets_every_message_once(user_executor: Executor, node: Node) -> None:
    received, publish = subscribe(node, callback_group=ReentrantCallbackGroup())
    submitted: set[Task] = set()
    with ThreadPoolExecutor(4) as pool:
        for batch in range(10):
            for number in range(10):
                publish(float(10 * batch + number))
            while len(received) < 10 * (batch + 1):
                with suppress(TimeoutException):
                    task = user_executor.wait_for_ready_callbacks(0.01)[0]
                    if task not in submitted:
                        submitted.add(task)
                        pool.submit(task)
    assert sorted(received) == [float(number) for number in range(100)]


@pytest.mark.parametrize("base", [SingleThreadedExecutor, MultiThreadedExecutor])
def test_spinning_selects_through_the_users_method(
    context: Context, make_node: MakeNode, base: type[SingleThreadedExecutor | MultiThreadedExecutor]
) -> None:
    selected: list[Any] = []

    class Selecting(base):  # type: ignore[valid-type,misc]
        def wait_for_ready_callbacks(self, *args: Any, **kwargs: Any) -> Any:
            selected.append(super().wait_for_ready_callbacks(*args, **kwargs))
            return selected[-1]

    node = make_node()
    with Selecting(context=context) as executor:
        executor.add_node(node)
        timer = node.create_timer(0.001, lambda: None)
        executor.spin_once(timeout_sec=10)
        assert selected[-1][1:] == (timer, node)
        timer.cancel()
        future = executor.create_task(lambda: 1)
        executor.spin_until_future_complete(future, timeout_sec=10)
        assert selected[-1] == (future, None, None)
        done = Future()
        executor.create_task(done.set_result, None)
        executor.spin_until_future_complete(done, timeout_sec=10)
        executor.spin_once_until_future_complete(done, timeout_sec=10)
        ran: list[bool] = []

        def end() -> None:
            ran.append(True)  # before the end: a thread of the executor goes on while `spin` returns
            context.try_shutdown()

        executor.create_task(end)
        with suppress(ExternalShutdownException):
            executor.spin()
        assert ran


def test_spinning_raises_the_exception_of_a_selected_callback(context: Context) -> None:
    class Selecting(SingleThreadedExecutor):
        def wait_for_ready_callbacks(self, *args: Any, **kwargs: Any) -> Any:
            return super().wait_for_ready_callbacks(*args, **kwargs)

    with Selecting(context=context) as executor:
        executor.create_task(lambda: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            executor.spin_once(timeout_sec=10)


def test_spin_until_future_complete_calls_the_users_single_step(context: Context) -> None:
    steps: list[float | None] = []

    class Stepping(SingleThreadedExecutor):
        def spin_once_until_future_complete(self, future: Future, timeout_sec: Any = None) -> None:
            steps.append(timeout_sec)
            super().spin_once_until_future_complete(future, timeout_sec)

    with Stepping(context=context) as executor:
        executor.spin_until_future_complete(executor.create_task(lambda: 1))
        assert steps == [None]


def test_what_a_user_has_begun_is_ended_by_other_spinning(
    executor: SingleThreadedExecutor, make_node: MakeNode
) -> None:
    node = make_node()
    executor.add_node(node)
    future: Future = Future()

    async def wait() -> Any:
        return await future

    waiting = executor.create_task(wait)
    executor.wait_for_ready_callbacks(10)[0]()
    received, publish = subscribe(node)
    publish(1.0)
    while not executor.wait_for_ready_callbacks(10)[1]:
        pass  # postponed
    future.set_result("done")
    executor.spin_until_future_complete(waiting, timeout_sec=10)
    assert waiting.result() == "done"
    while not received:
        executor.spin_once(timeout_sec=10)
    assert received == [1.0]
