"""Futures and tasks, without an executor and with one that the test runs by hand."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from rclpy.task import Future, Task


class ManualExecutor:
    def __init__(self) -> None:
        self.tasks: list[Task] = []

    def create_task(self, callback: Callable[..., Any], *args: Any) -> Task:
        self.tasks.append(Task(callback, args, executor=self))  # type: ignore[arg-type]
        return self.tasks[-1]

    def run(self) -> None:
        for task in list(self.tasks):
            task()


def future_of(executor: ManualExecutor) -> Future:
    return Future(executor=executor)  # type: ignore[arg-type]


def test_a_future_may_be_awaited_in_asyncio() -> None:
    future = Future()

    async def wait() -> Any:
        return await future

    async def complete() -> Any:
        waiting = asyncio.create_task(wait())
        await asyncio.sleep(0)
        future.set_result(42)
        return await asyncio.wait_for(waiting, 10)

    assert asyncio.run(complete()) == 42


def test_a_future_begins_pending() -> None:
    future = Future()
    assert (future.done(), future.cancelled(), future.result(), future.exception()) == (
        False,
        False,
        None,
        None,
    )


def test_a_future_with_a_result_is_done() -> None:
    future = Future()
    future.set_result("sentinel")
    assert future.done()
    assert future.result() == "sentinel"


def test_a_future_with_an_exception_is_done_and_raises_it() -> None:
    future = Future()
    future.set_exception(ValueError("no"))
    assert future.done()
    assert isinstance(future.exception(), ValueError)
    with pytest.raises(ValueError, match="no"):
        future.result()


def test_an_exception_never_retrieved_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    Future().set_exception(ValueError("lost"))
    assert "never retrieved: lost" in capsys.readouterr().err
    fetched = Future()
    fetched.set_exception(ValueError("found"))
    fetched.exception()
    del fetched
    assert capsys.readouterr().err == ""


def test_cancelling_a_future_calls_its_callbacks_but_leaves_it_not_done() -> None:
    called: list[Future] = []
    future = Future()
    future.add_done_callback(called.append)
    future.cancel()
    assert future.cancelled()
    assert not future.done()
    assert called == [future]


def test_a_done_future_cannot_be_cancelled() -> None:
    future = Future()
    future.set_result(1)
    future.cancel()
    assert not future.cancelled()
    assert future.done()


def test_a_cancelled_future_may_still_get_a_result() -> None:
    future = Future()
    future.cancel()
    future.set_result(1)
    assert (future.cancelled(), future.done(), future.result()) == (False, True, 1)


def test_a_failing_done_callback_does_not_stop_the_others() -> None:
    called: list[Future] = []

    def fail(future: Future) -> None:
        raise RuntimeError("bad callback")

    future = Future()
    future.add_done_callback(fail)
    future.add_done_callback(called.append)
    with pytest.warns(UserWarning, match="bad callback"):
        future.set_result(None)
    assert called == [future]


def test_a_callback_added_to_a_done_future_runs_at_once_and_may_raise() -> None:
    future = Future()
    future.set_result(None)
    called: list[Future] = []
    future.add_done_callback(called.append)
    assert called == [future]

    def fail(future: Future) -> None:
        raise RuntimeError("bad callback")

    with pytest.raises(RuntimeError, match="bad callback"):
        future.add_done_callback(fail)


def test_done_callbacks_run_on_the_executor() -> None:
    called: list[Future] = []
    executor = ManualExecutor()
    future = future_of(executor)
    future.add_done_callback(called.append)
    future.set_result(None)
    future.add_done_callback(called.append)
    assert called == []
    executor.run()
    assert called == [future, future]


def test_a_future_does_not_keep_its_executor_alive() -> None:
    called: list[Future] = []
    executor = ManualExecutor()
    future = future_of(executor)
    future.add_done_callback(called.append)
    del executor
    future.set_result(None)
    assert called == [future]


def test_a_task_stores_the_result_or_exception_of_its_function() -> None:
    task = Task(lambda a, b: a + b, args=[1], kwargs={"b": 2})
    task()
    assert (task.done(), task.executing(), task.result()) == (True, False, 3)

    task = Task(int, args=["x"])
    task()
    with pytest.raises(ValueError, match="invalid literal"):
        task.result()


def test_a_task_runs_once() -> None:
    calls: list[int] = []
    task = Task(calls.append, args=[1])
    task()
    task()
    assert calls == [1]


def test_an_executing_task_does_not_run_again() -> None:
    observed: list[bool] = []

    def function() -> None:
        observed.append(task.executing())
        task()

    task = Task(function)
    task()
    assert observed == [True]


def test_each_call_advances_a_coroutine_to_its_next_await() -> None:
    future = Future()

    async def coroutine(x: int) -> int:
        return x + int(await future)

    task = Task(coroutine, args=[1])
    task()
    assert not task.done()
    task()
    assert not task.done()
    future.set_result(2)
    task()
    assert task.result() == 3


def test_a_task_accepts_a_coroutine_object() -> None:
    async def coroutine() -> str:
        return "done"

    task = Task(coroutine())
    task()
    assert task.result() == "done"


def test_a_coroutine_awaits_tasks_and_gets_their_exceptions() -> None:
    inner = Task(int, args=["x"])

    async def coroutine() -> str:
        try:
            await inner
        except ValueError:
            return "caught"
        return "missed"

    outer = Task(coroutine)
    outer()
    inner()
    outer()
    assert outer.result() == "caught"


def test_a_finished_task_releases_its_arguments() -> None:
    import weakref

    class Big:
        pass

    big = Big()
    alive = weakref.ref(big)
    task = Task(lambda argument: None, args=[big])
    del big
    task()
    assert alive() is None


def test_a_removed_done_callback_is_not_called() -> None:
    future: Future = Future()
    called: list[Future] = []
    future.add_done_callback(called.append)
    assert future.remove_done_callback(called.append)
    assert not future.remove_done_callback(called.append)
    future.set_result(None)
    assert called == []
