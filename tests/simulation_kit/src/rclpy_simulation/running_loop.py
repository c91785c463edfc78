"""The event loop that runs, of each simulated thread: asyncio keeps it for each real one."""

from __future__ import annotations

from asyncio import events, tasks
from typing import Any


def leave() -> Any:
    """Take the loop and the task that run out of asyncio's variables, which all simulated threads share."""
    loop = events._get_running_loop()
    if loop is None:
        return None
    task = tasks.current_task(loop)
    if task is not None:
        tasks._leave_task(loop, task)
    events._set_running_loop(None)
    return loop, task


def enter(left: Any) -> None:
    """Put back what :func:`leave` has returned."""
    if left is not None:
        loop, task = left
        events._set_running_loop(loop)
        if task is not None:
            tasks._enter_task(loop, task)
