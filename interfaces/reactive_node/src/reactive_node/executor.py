"""The fastest executor of one thread that the rclpy at hand has.

ROS 2's ``rclpy.experimental.EventsExecutor`` takes a third of the processor time of its default executor, and
has faults. Those that were found are worked around here and in :mod:`reactive_node.stand_ins`;
``tests/test_events_executor.py`` has a test for each.
"""

from __future__ import annotations

import importlib
import math
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future, Task

from reactive_node import request_memory
from reactive_node.stand_ins import NO_NODE, Window

try:
    _experimental: Any = importlib.import_module("rclpy.experimental")
except ImportError:
    _experimental = None
_TURN = 0.25  # [s] between two looks for QoS events; an endless wait is a busy loop in wheels for glibc 2.28


def create_executor(context: Context | None = None) -> Executor:
    """Return an executor that runs callbacks on the thread that spins it: the fastest that this rclpy has.

    Its interface is that of :class:`rclpy.executors.Executor`. Where it is ROS 2's EventsExecutor, guard
    conditions are refused, QoS events come up to 0.25 s late, a callback group only decides whether an entity
    is read at all, and :meth:`shutdown` must not be called inside a callback.

    :param context: as of :class:`rclpy.executors.Executor`.
    """
    if _experimental is None:
        return SingleThreadedExecutor(context=context)
    return _SteadyEventsExecutor(context)


class _SteadyEventsExecutor(Executor):
    """An EventsExecutor without its known faults.

    It only calls ``spin_once``: what waits for a future leaves 32 octets behind at each call. It runs tasks
    itself: a ``spin_once`` with a task that waits would return at once, each time.
    """

    def __init__(self, context: Context | None) -> None:
        super().__init__(context=context)
        self._events = _experimental.EventsExecutor(context=self.context)
        self._windows: dict[Node, Window] = {}
        # With one node, an exception of a task or of a QoS event is a segmentation fault (ros2/rclpy#1641).
        self._events.add_node(NO_NODE)
        self._unfinished: deque[Task] = deque()
        self._is_waking = False
        self._was_called = False  # in the last turn: a callback, or a task that has ended
        self._ends = False
        self._next_events = 0.0  # [s, monotonic]

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        task = Task(callback, args, kwargs, executor=self)
        self._unfinished.append(task)
        self._end_turn()
        return task

    def add_node(self, node: Node) -> bool:
        if node in self._windows:
            return False
        self._windows[node] = Window(node, self.create_task)
        self._events.add_node(self._windows[node])
        node.executor = self
        return True

    def remove_node(self, node: Node) -> None:
        window = self._windows.pop(node, None)
        if window is not None:
            self._events.remove_node(window)

    def get_nodes(self) -> list[Node]:
        return list(self._windows)

    def wake(self) -> None:
        for window in [*self._windows.values()]:
            window.refresh()
        self._events.wake()
        self._end_turn()  # another thread may have completed the future of a task

    def spin(self) -> None:
        self.spin_until_future_complete(Future())

    def spin_once(self, timeout_sec: float | None = None) -> None:
        self.spin_once_until_future_complete(Future(), timeout_sec)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        with self._ended_by(future):
            now, end = time.monotonic(), _end(timeout_sec)
            while not self._ends and not future.done():
                now = self._take_turn(now, end)
                if now >= end:
                    return

    def spin_once_until_future_complete(self, future: Future, timeout_sec: Any = None) -> None:
        with self._ended_by(future):
            now, end = time.monotonic(), _end(timeout_sec)
            while not self._ends and not future.done():
                now = self._take_turn(now, end)
                if now >= end or self._was_called:
                    return

    @contextmanager
    def _ended_by(self, future: Future) -> Iterator[None]:
        """End the turn in which a future completes."""

        def end(_: Future) -> None:
            self._end_turn()

        future.add_done_callback(end)
        try:
            yield
        finally:
            future.remove_done_callback(end)

    def _take_turn(self, now: float, end: float) -> float:
        """Call what is ready, or wait for it, until ``end`` at most; return the time [s, monotonic]."""
        if now >= self._next_events:
            self._next_events = now + _TURN
            for window in [*self._windows.values()]:
                window.take_events()
        turn_end = min(end, self._next_events)
        self._was_called = True
        try:
            self._events.spin_once(max(0.0, turn_end - now))
        finally:
            request_memory.free()
        now = time.monotonic()
        if now >= turn_end:
            self._was_called = False
        if self._unfinished:
            self._run_tasks()
        return now

    def _end_turn(self) -> None:
        """End this turn, or the next one: ``spin_once`` returns after a task of EventsExecutor."""
        if not self._is_waking:
            self._is_waking = True
            self._events.create_task(self._wake_up)

    def _wake_up(self) -> None:
        self._is_waking = self._was_called = False

    def _run_tasks(self) -> None:
        """Run all tasks as far as they come."""
        for _ in range(len(self._unfinished)):
            task = self._unfinished.popleft()
            task()
            if not task.done():
                self._unfinished.append(task)
                continue
            self._was_called = True
            if self._unfinished:  # one of them may wait for this one
                self._end_turn()
            if (error := task.exception()) is not None:
                raise error

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._ends = True
        if not self._events.shutdown(timeout_sec=timeout_sec):
            return False
        self._windows.clear()
        self._unfinished.clear()
        return super().shutdown(timeout_sec)


def _end(timeout_sec: float | None) -> float:
    if timeout_sec is None or timeout_sec < 0.0:
        return math.inf
    return time.monotonic() + timeout_sec
