"""The event loop that runs, of each simulated thread: asyncio keeps it for each real one."""

from __future__ import annotations

from asyncio import events, tasks
from typing import Any

present = events._get_running_loop
"""Returns the loop that runs now, or None."""


def leave() -> Any:
    """Take the loop and the task that run out of asyncio's variables, which all simulated threads share."""
    loop: Any = present()
    task = tasks.current_task(loop)
    if task is not None:
        tasks._leave_task(loop, task)
    events._set_running_loop(None)
    return loop, task


def enter(left: Any) -> None:
    """Put back what :func:`leave` has returned."""
    loop, task = left
    events._set_running_loop(loop)
    if task is not None:
        tasks._enter_task(loop, task)
