"""rclpy's EventsExecutor, as its experimental module makes it: callbacks in the order of their events."""

from __future__ import annotations

import inspect
import math
import time
from collections import deque
from types import TracebackType
from typing import Any

from rclpy_ground import choice
from rclpy_ground.interface import INFINITY

_BETWEEN_LOOKS = 1_000_000
"""How long it waits at most while a coroutine waits [ns]."""


class EventsExecutor:
    def __init__(self, context: Any) -> None:
        from rclpy.executors import ExternalShutdownException
        from rclpy.task import Task

        self._task, self._error_of_shutdown = Task, ExternalShutdownException
        self._context = context
        self._nodes: dict[Any, None] = {}
        self._wait_set = choice.ground.create_wait_set()
        self._guard = choice.ground.create_guard_condition()
        self._wait_set.attach(self._guard.handle, 0)
        self._handle = context.handle
        self._signal = self._handle.guard
        self._wait_set.attach(self._signal.handle, 1)
        self._entities: dict[Any, list[tuple[int, Any]]] = {}  # with their tokens and conditions
        self._work: dict[int, tuple[Any, Any]] = {}  # by token
        self._next_token = 2
        self._timers: list[tuple[Any, Any]] = []  # their handles, and the work of each
        self._ready: deque[tuple[Any, Any]] = deque()
        self._unfinished: list[tuple[Any, Any]] = []
        """Coroutines that wait: nothing says what for, so they go on after each wait."""
        self._changed = True
        self._stopped = self._spins = False

    # Executor's interface

    @property
    def context(self) -> Any:
        return self._context

    def create_task(self, callback: Any, *arguments: Any, **options: Any) -> Any:
        this: Any = self  # rclpy's own does not derive from Executor either
        task = self._task(callback, arguments, options, executor=this)
        self._ready.append((self._run_task, task))
        self._guard.trigger()
        return task

    def create_future(self) -> Any:
        from rclpy.task import Future

        this: Any = self
        return Future(executor=this)

    def _call_task_in_next_spin(self, task: Any) -> None:
        self._ready.append((self._run_task, task))
        self._guard.trigger()

    def add_node(self, node: Any) -> bool:
        if node in self._nodes:
            return False
        self._nodes[node] = None
        node.executor = self
        self.wake()
        return True

    def remove_node(self, node: Any) -> None:
        if node in self._nodes:
            del self._nodes[node]
            self.wake()

    def get_nodes(self) -> list[Any]:
        return [*self._nodes]

    def wake(self) -> None:
        self._changed = True
        self._guard.trigger()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._stop()
        self._nodes.clear()
        self._changed = True
        if not self._spins:
            self._update()
        return True

    def _stop(self, _: Any = None) -> None:
        self._stopped = True
        self._guard.trigger()

    def spin(self) -> None:
        self._spin(None, False)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        self._spin(timeout_sec, True)

    def spin_until_future_complete(self, future: Any, timeout_sec: float | None = None) -> None:
        future.add_done_callback(self._stop)
        self._spin(timeout_sec, False)
        if hasattr(future, "remove_done_callback"):
            future.remove_done_callback(self._stop)

    def spin_once_until_future_complete(self, future: Any, timeout_sec: float | None = None) -> None:
        future.add_done_callback(self._stop)
        self._spin(timeout_sec, True)

    def __enter__(self) -> EventsExecutor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.shutdown()

    # Its loop

    def _spin(self, timeout: float | None, once: bool) -> None:
        if self._spins:
            raise RuntimeError("Attempt to spin an already-spinning Executor")
        now = time.monotonic_ns()
        limit = INFINITY if timeout is None else now + math.ceil(timeout * 1e9)
        self._spins = True
        ready, wait = self._ready, self._wait_set.wait
        try:
            while not self._stopped:
                if self._changed:
                    self._update()
                if not ready:
                    left = self._time_left(now, limit)
                    tokens = wait(min(left, _BETWEEN_LOOKS) if self._unfinished else left)
                    if not self._handle.is_valid:
                        self._nodes.clear()
                        self._update()
                        break
                    for token in tokens:
                        if token > 1:
                            if (work := self._work.get(token)) is not None:
                                ready.append(work)
                        elif token == 0:
                            self._guard.take()
                        else:
                            self._signal.take()
                    ready.extend(self._unfinished)
                    self._unfinished.clear()
                    if not ready:
                        now = time.monotonic_ns()
                        if now >= limit and not self._changed:
                            break
                        continue
                handle, entity = ready.popleft()
                handle(entity)
                if once:
                    break
                now = time.monotonic_ns()
        finally:
            self._spins = self._stopped = False
        if not self._handle.is_valid:
            raise self._error_of_shutdown

    def _time_left(self, now: int, limit: int) -> int:
        """Return the time to wait [ns], until a limit at most; 0 with timers that are due: they become ready.

        :param now: by the steady clock [ns], as the limit.
        """
        left = limit - now
        for handle, work in self._timers:
            remaining = handle.remaining(now)
            if remaining <= 0:
                self._ready.append(work)
            if remaining < left:
                left = remaining
        return left if left > 0 else 0

    def _update(self) -> None:
        self._changed = False
        if not self._handle.is_valid:
            self._nodes.clear()
        wanted: dict[Any, Any] = {}
        timers: dict[Any, Any] = {}
        for node in self._nodes:
            for name, handler in self._HANDLERS.items():
                for entity in getattr(node, name):
                    wanted[entity] = handler
            for timer in node.timers:
                timers[timer.handle] = self._run_timer, timer
            for waitable in node.waitables:
                for timer in _parts(waitable, "remaining"):
                    timers[timer] = self._run_waitable, waitable
        self._timers = [*timers.items()]
        for entity in [each for each in self._entities if each not in wanted]:
            for token, condition in self._entities.pop(entity):
                self._wait_set.detach(condition)
                del self._work[token]
        for entity, handler in wanted.items():
            if entity not in self._entities:
                self._entities[entity] = [
                    self._watch(condition, handler.__get__(self), entity) for condition in _conditions(entity)
                ]

    def _watch(self, condition: Any, handler: Any, entity: Any) -> tuple[int, Any]:
        token = self._next_token
        self._next_token += 1
        self._work[token] = handler, entity
        self._wait_set.attach(condition, token)
        return token, condition

    def _run_task(self, task: Any) -> None:
        task()
        if not task.done():
            self._unfinished.append((self._run_task, task))
        elif (error := task.exception()) is not None:
            raise error

    def _later(self, result: Any) -> None:
        """Run what a callback returned, if it was a coroutine."""
        if inspect.iscoroutine(result):
            self.create_task(result)

    def _run_timer(self, timer: Any) -> None:
        if timer.handle.call_if_ready() and (result := timer.callback()) is not None:
            self._later(result)

    def _run_subscription(self, subscription: Any) -> None:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is not None:
            arguments = taken[:1] if subscription._callback_type.value == 0 else taken
            if (result := subscription.callback(*arguments)) is not None:
                self._later(result)

    def _run_service(self, service: Any) -> None:
        request, header = service.handle.service_take_request(service.srv_type.Request)
        if header is not None:
            response = service.callback(request, service.srv_type.Response())
            if inspect.iscoroutine(response):

                async def send() -> None:
                    service.send_response(await response, header)

                self.create_task(send)
            else:
                service.send_response(response, header)

    def _run_client(self, client: Any) -> None:
        header, response = client.handle.take_response(client.srv_type.Response)
        if header is not None:
            try:
                future = client.get_pending_request(header.request_id.sequence_number)
            except KeyError:
                return
            future._set_executor(self)
            future.set_result(response)

    def _run_waitable(self, waitable: Any) -> None:
        wait_set = _Now()
        waitable.add_to_wait_set(wait_set)
        if waitable.is_ready(wait_set):
            data = waitable.take_data()
            this: Any = self
            for future in getattr(waitable, "_futures", ()):
                future._set_executor(self)
            # At once: a task that waits for its turn is never awaited if spinning ends before.
            self._run_task(self._task(waitable.execute, (data,), {}, executor=this))

    _HANDLERS = {
        "subscriptions": _run_subscription,
        "clients": _run_client,
        "services": _run_service,
        "waitables": _run_waitable,
    }


class _Now:
    """A wait set that says which entities are ready now."""

    def __init__(self) -> None:
        self.entities: list[Any] = []

    def _add(self, entity: Any, kind: str = "") -> int:
        self.entities.append(entity)
        return len(self.entities) - 1

    add_subscription = add_client = add_service = add_event = add_guard_condition = add_timer = _add

    def is_ready(self, kind: str, index: int) -> bool:
        entity = self.entities[index]
        if kind == "event":
            return bool(entity.look())
        if kind == "timer":
            return bool(entity.is_timer_ready())
        return True


def _conditions(entity: Any) -> list[Any]:
    handle = getattr(entity, "handle", None)
    if handle is not None and hasattr(handle, "condition"):
        return [handle.condition]
    return [each.condition for each in _parts(entity, "condition")]


def _parts(waitable: Any, attribute: str) -> list[Any]:
    """Return what a waitable waits for and has this attribute."""
    wait_set = _Now()
    waitable.add_to_wait_set(wait_set)
    return [each for each in wait_set.entities if hasattr(each, attribute)]
