"""Cancelled and interrupted coroutines: they end, where those of rclpy continue or wait."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from rclpy.task import Future, Task


def test_awaiting_a_cancelled_future_returns_none() -> None:
    future = Future()

    async def coroutine() -> Any:
        return await future

    task = Task(coroutine)
    task()
    future.cancel()
    task()
    assert task.done()
    assert task.result() is None


def test_a_cancelled_coroutine_runs_only_its_finally_clauses() -> None:
    events: list[str] = []
    future = Future()

    async def coroutine() -> None:
        try:
            await future
            events.append("continued")
        finally:
            events.append("cleaned up")

    task = Task(coroutine)
    task()
    task.cancel()
    future.set_result(None)
    task()
    assert events == ["cleaned up"]
    assert task.cancelled()


def test_a_keyboard_interrupt_ends_its_task_and_propagates() -> None:
    calls: list[int] = []

    def function() -> None:
        calls.append(1)
        raise KeyboardInterrupt

    async def coroutine() -> None:
        function()

    handlers: list[Callable[[], None] | Callable[[], Coroutine[Any, Any, None]]] = [function, coroutine]
    for handler in handlers:
        calls.clear()
        task = Task(handler)
        with pytest.raises(KeyboardInterrupt):
            task()
        task()
        assert calls == [1]
        assert task.cancelled()
