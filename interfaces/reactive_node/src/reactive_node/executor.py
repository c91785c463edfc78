"""The fastest executor of one thread that the rclpy at hand has.

ROS 2's ``rclpy.experimental.EventsExecutor`` takes a third of the processor time of its default executor, and
has faults. Those that were found are worked around here and in :mod:`reactive_node.stand_ins`;
``tests/test_events_executor.py`` has a test for each.
"""

from __future__ import annotations

import importlib
import math
import time
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future, Task

from reactive_node.stand_ins import NO_NODE, Turn, Window

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
    """An EventsExecutor without its known faults."""

    def __init__(self, context: Context | None) -> None:
        super().__init__(context=context)
        self._turn = Turn()
        self._events = _experimental.EventsExecutor(context=self.context)
        self._windows: dict[Node, Window] = {}
        # With one node, an exception of a task or of a QoS event is a segmentation fault (ros2/rclpy#1641).
        self._events.add_node(NO_NODE)
        self._ends = False
        self._next_events = 0.0  # [s, monotonic]

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        task: Task = self._events.create_task(callback, *args, **kwargs)
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
        self._turn.end()  # a new turn resumes the tasks whose futures another thread has completed

    def spin(self) -> None:
        self.spin_until_future_complete(Future())

    def spin_once(self, timeout_sec: float | None = None) -> None:
        self.spin_once_until_future_complete(Future(), timeout_sec)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        end = _end(timeout_sec)
        future.add_done_callback(lambda _: self._turn.end())
        while not self._ends and self.context.ok() and not future.done():
            self._events.spin_until_future_complete(self._turn, timeout_sec=self._begin_turn(end))
            if time.monotonic() >= end:
                return

    def spin_once_until_future_complete(self, future: Future, timeout_sec: Any = None) -> None:
        end = _end(timeout_sec)
        while not future.done() and not self._ends:
            turn = self._begin_turn(end)
            turn_end = time.monotonic() + turn
            self._events.spin_once_until_future_complete(future, timeout_sec=turn)
            now = time.monotonic()
            if now < turn_end or now >= end:  # something was called, or nothing in time
                return

    def _begin_turn(self, end: float) -> float:
        """Take the QoS events if it is time to; return the time that the turn may take [s]."""
        now = time.monotonic()
        if now >= self._next_events:
            self._next_events = now + _TURN
            for window in [*self._windows.values()]:
                window.take_events()
        return max(0.0, min(end, self._next_events) - now)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._ends = True
        if not self._events.shutdown(timeout_sec=timeout_sec):
            return False
        self._windows.clear()
        return super().shutdown(timeout_sec)


def _end(timeout_sec: float | None) -> float:
    if timeout_sec is None or timeout_sec < 0.0:
        return math.inf
    return time.monotonic() + timeout_sec
