"""Executors: they wait for events of nodes and run the callbacks.

An executor waits in a DDS wait set, with the interpreter lock released. The wait set has a condition for each
reader, and a guard condition for all other changes: timers, tasks, guard conditions, created and destroyed
entities. So no executor polls, and a change from any thread takes effect at once. Only the spinning thread
uses the wait set (``_executor_entities``); other threads set a flag and trigger the guard condition. Every
message takes the path between two waits, so this path looks at one flag only.
"""

from __future__ import annotations

import inspect
import os
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Coroutine
from contextlib import AbstractContextManager
from functools import partial
from types import CoroutineType, TracebackType
from typing import TYPE_CHECKING, Any

from rclpy import _dds, signals
from rclpy._dds import INFINITY
from rclpy._executor_entities import WAKE
from rclpy._executor_offers import ExecutorOffers, Offer
from rclpy.client import Client  # noqa: F401 (re-export)
from rclpy.constants import S_TO_NS
from rclpy.exceptions import InvalidHandle, NotInitializedException  # noqa: F401 (re-export)
from rclpy.guard_condition import GuardCondition  # noqa: F401 (re-export)
from rclpy.task import Future, Task
from rclpy.utilities import get_default_context

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node


class TimeoutException(Exception):
    """Raised when no callback became ready in time."""


class ShutdownException(Exception):
    """Raised when the executor was shut down."""


class ExternalShutdownException(Exception):
    def __init__(self, *args: object) -> None:
        super().__init__(*(args or ("the context was shut down by a signal or another thread",)))


class ConditionReachedException(Exception):
    """Future has been completed."""


_ENDS = (TimeoutException, ShutdownException, ExternalShutdownException, ConditionReachedException)


class TimeoutObject:
    """A timeout for several calls together."""

    def __init__(self, timeout: float) -> None:
        self._rclpy_deadline = _deadline(timeout)

    @property
    def timeout(self) -> float:
        """Remaining time [s], never negative; -1: no timeout."""
        if self._rclpy_deadline is None:
            return -1.0
        return _remaining(self._rclpy_deadline) / S_TO_NS


def _deadline(timeout: float | TimeoutObject | None) -> int | None:
    """Convert a timeout [s] to a deadline of the steady clock [ns]; ``None``: no deadline."""
    if isinstance(timeout, TimeoutObject):
        return timeout._rclpy_deadline
    if timeout is None or timeout < 0:
        return None
    return time.monotonic_ns() + int(timeout * S_TO_NS)


def _remaining(deadline: int | None) -> int:
    """Return the time until a deadline [ns], never negative."""
    return INFINITY if deadline is None else max(0, deadline - time.monotonic_ns())


async def await_or_execute(callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any) -> Any:
    """Call ``callback``; if it is a coroutine function, await its result."""
    if inspect.iscoroutinefunction(callback):
        return await callback(*args)
    assert callable(callback)
    return callback(*args)


class Executor(ExecutorOffers, AbstractContextManager["Executor"]):
    """Waits for ready callbacks of its nodes. Subclasses decide how and on which thread they run."""

    def __init__(self, *, context: Context | None = None) -> None:
        """Create an executor. Raises NotInitializedException if the context does not run."""
        self._context = get_default_context() if context is None else context
        if not self._context._rclpy_valid:
            raise NotInitializedException
        super().__init__()
        # The default of rclpy.spin(), which returns silently after rclpy.shutdown().
        self._rclpy_is_global = False
        self._rclpy_closed = False
        self._rclpy_idle = threading.Condition()
        self._rclpy_spinning_thread: int | None = None
        self._context._rclpy_executors.add(self)
        signals._watch(self)

    @property
    def context(self) -> Context:
        return self._context

    # Nodes

    def add_node(self, node: Node) -> bool:
        """Add a node, whose callbacks this executor runs. Return ``False`` if it was added before."""
        with self._nodes_lock:
            if node in self._nodes:
                return False
            if node.executor is not None:
                node.executor.remove_node(node)
            self._nodes.append(node)
        node._rclpy_executor = weakref.ref(self)
        self._rclpy_entities_have_changed()
        return True

    def remove_node(self, node: Node) -> None:
        """Remove a node: this executor stops running its callbacks."""
        with self._nodes_lock:
            if node not in self._nodes:
                return
            self._nodes.remove(node)
        self._rclpy_entities_have_changed()

    # Tasks

    def create_task(
        self, callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any, **kwargs: Any
    ) -> Task:
        """Run a function or coroutine on this executor; return its task, a future of the result."""
        task = Task(callback, args, kwargs, executor=self)
        self._rclpy_schedule(task)
        return task

    def _rclpy_schedule(self, task: Task) -> None:
        self._tasks.append(task)
        self._rclpy_wake_if_waiting()

    def _rclpy_continue_later(self, task: Task) -> None:
        offered = task in self._rclpy_offers
        resume = self._rclpy_change_offers if offered else partial(self._rclpy_schedule, task)
        awaited = task._rclpy_awaited
        if awaited is None:
            resume()
        else:
            awaited._rclpy_call_when_complete(resume)

    # Spinning

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        while self._context._rclpy_valid and not self._is_shutdown:
            self.spin_once()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback; wait for it at most ``timeout_sec`` (``None`` or negative: no limit).

        Custom executors implement this with :meth:`wait_for_ready_callbacks`.
        """
        raise NotImplementedError

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until ``future`` is done or cancelled, at most for ``timeout_sec``."""
        future._rclpy_call_when_complete(self.wake)
        timeout = None if timeout_sec is None or timeout_sec < 0 else TimeoutObject(timeout_sec)
        while self._context._rclpy_valid and not self._is_shutdown and not future._rclpy_is_over():
            self.spin_once_until_future_complete(future, timeout)
            if timeout is not None and not timeout.timeout:
                return

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        """Run one callback, unless ``future`` is done before one is ready.

        Custom executors that support :meth:`spin_until_future_complete` implement this.
        """
        raise NotImplementedError

    def wait_for_ready_callbacks(
        self,
        timeout_sec: float | TimeoutObject | None = None,
        nodes: list[Node] | None = None,
        condition: Callable[[], bool] = lambda: False,
    ) -> Offer:
        """Wait for a ready callback and return it as a task, with its entity and node.

        :param nodes: wait for callbacks of these nodes; ``None``: those of this executor.
        :raises TimeoutException, ShutdownException, ExternalShutdownException, ConditionReachedException:
            if the wait ends without one.
        """
        if (end := self._rclpy_reason_to_end(condition)) is not None:
            raise end
        deadline = _deadline(timeout_sec)
        while (offer := self._rclpy_next_offer(nodes)) is None:
            found: list[Any] = []
            if nodes is not None:
                self._rclpy_wait_only_for(list(nodes))
            try:
                end = self._rclpy_work(
                    partial(self._rclpy_reserve, found.append),
                    deadline,
                    lambda: condition() or self._rclpy_offers_changed,
                    once=True,
                )
            finally:
                if nodes is not None:
                    self._rclpy_wait_only_for(None)
            if found:
                return self._rclpy_offer(found[0], self.get_nodes() if nodes is None else nodes)
            if end is not None and (end is not ConditionReachedException or condition()):
                raise end
        return offer

    def _rclpy_work(
        self,
        handle: Callable[[Any], bool],
        deadline: int | None,
        condition: Callable[[], bool] | None,
        *,
        once: bool = False,
    ) -> type[Exception] | None:
        """Wait for work and hand it on, until the deadline has passed or there is another reason to end.

        :param handle: gets a ready entity or task; returns whether there was work to do.
        :param condition: whether the caller wants the end; asked at first, and after each :meth:`wake`.
        :param once: return after one piece of work.
        :return: the reason to end; ``None`` after work.
        """
        ready, repeatable = self._rclpy_ready, self._rclpy_repeatable
        self._rclpy_changed = True  # whatever has happened meanwhile
        if self._rclpy_blocked:  # another executor may have freed a callback group
            self._rclpy_groups_changed = True
        waited = False
        while True:
            if self._rclpy_changed and (end := self._rclpy_handle_changes(condition)) is not None:
                return end
            if ready:
                entity, reader = ready.popleft()
                if handle(entity):
                    if reader and self._rclpy_burst_end:
                        repeatable.append((entity, reader))
                    if once or (self._rclpy_changed and not self._context._rclpy_valid):
                        return None
                    if deadline is not None and time.monotonic_ns() >= deadline:
                        return None
                del entity  # the next wait may be long: keep no object alive
            elif repeatable and time.monotonic_ns() < self._rclpy_burst_end:
                ready.extend(repeatable)
                repeatable.clear()
            else:
                if waited and deadline is not None and time.monotonic_ns() >= deadline:
                    return TimeoutException
                repeatable.clear()
                self._rclpy_collect(deadline)
                waited = True

    def _rclpy_handle_changes(self, condition: Callable[[], bool] | None) -> type[Exception] | None:
        """Handle what callbacks and other threads have changed; return the reason to end the wait, if any."""
        self._rclpy_changed = False  # first: later changes are handled in the next round
        if (end := self._rclpy_reason_to_end(condition)) is not None:
            return end
        if self._rclpy_entities_changed:
            self._rclpy_update_entities()
        if self._rclpy_groups_changed:
            self._rclpy_unblock()
        return None

    def _rclpy_reason_to_end(self, condition: Callable[[], bool] | None) -> type[Exception] | None:
        """Return the exception that tells why to end the wait for work, if there is a reason."""
        if self._is_shutdown or not self._context._rclpy_valid:
            in_order = (
                not self._context._rclpy_ended_by_signal if self._rclpy_is_global else self._is_shutdown
            )
            return ShutdownException if in_order else ExternalShutdownException
        if condition is not None and condition():
            return ConditionReachedException
        return None

    def _rclpy_begin(self, entity: Any) -> Any:
        """Take the data of a ready entity; ``None`` if its callback must not run."""
        if entity.__class__ is Task:
            return ()
        group = entity.callback_group
        if group is not None and not group.beginning_execution(entity):
            self._rclpy_block(entity)
            return None
        try:
            taken = entity._rclpy_take()
        except BaseException:
            self._rclpy_end_execution(entity)
            raise
        if taken is None and group is not None:
            group.ending_execution(entity)
        return taken

    # Running

    def _rclpy_run(self, entity: Any, taken: Any) -> None:
        """Run a task, or the callback of an entity with the data; exceptions of the callback propagate."""
        if entity.__class__ is Task:
            entity()
            _raise_exception_of(entity)
            return
        try:
            result = entity._rclpy_execute(taken)
        except BaseException:
            self._rclpy_end_execution(entity)
            raise
        if result.__class__ is CoroutineType:
            self._rclpy_run_coroutine(entity, result)
        else:
            self._rclpy_end_execution(entity)

    def _rclpy_run_coroutine(self, entity: Any, coroutine: Any) -> None:
        """Run what a callback has returned; its callback group is busy until the coroutine ends."""
        task = Task(coroutine, executor=self)
        task._rclpy_call_when_complete(lambda: self._rclpy_end_execution(entity))
        task()
        _raise_exception_of(task)

    def _rclpy_is_idle(self) -> bool:
        return self._rclpy_spinning_thread is None

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop; return whether callbacks on other threads end within ``timeout_sec`` (``None``: no limit)."""
        if not self._is_shutdown:
            self._is_shutdown = self._rclpy_changed = True
            self._guard.trigger()
        # A callback or signal handler on the spinning thread cannot wait for its own end.
        if threading.get_ident() != self._rclpy_spinning_thread:
            with self._rclpy_idle:
                if not self._rclpy_idle.wait_for(self._rclpy_is_idle, timeout_sec):
                    return False
        if not self._rclpy_closed:
            self._rclpy_closed = True
            for node in self.get_nodes():
                self.remove_node(node)
            for task in self._rclpy_offers:
                task._rclpy_cancel_before_start()
            self._context._rclpy_executors.discard(self)
            self._rclpy_close()
        return True

    def _rclpy_close(self) -> None:
        self._rclpy_close_dds()

    def __enter__(self) -> Executor:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        self.shutdown()


def _raise_exception_of(task: Task) -> None:
    if task.done() and task.exception() is not None:
        task.result()


class _BuiltInExecutor(Executor):
    """Base of this module's executors, with a minimum of code between waiting and callback."""

    _rclpy_spin_ends = frozenset([TimeoutException, ShutdownException, ConditionReachedException])
    """These end the spinning without an error."""

    def spin(self) -> None:
        if self._rclpy_overrides("spin_once", "wait_for_ready_callbacks"):
            super().spin()
            return
        while self._context._rclpy_valid and not self._is_shutdown:
            self._rclpy_spin(None, None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        self._rclpy_spin(_deadline(timeout_sec), None, once=True)

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        future._rclpy_call_when_complete(self.wake)
        self._rclpy_spin(_deadline(timeout_sec), future._rclpy_is_over, once=True)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        if self._rclpy_overrides("spin_once_until_future_complete", "wait_for_ready_callbacks"):
            super().spin_until_future_complete(future, timeout_sec)
            return
        future._rclpy_call_when_complete(self.wake)
        if self._context._rclpy_valid:
            self._rclpy_spin(_deadline(timeout_sec), future._rclpy_is_over)

    def _rclpy_spin(
        self, deadline: int | None, condition: Callable[[], bool] | None, *, once: bool = False
    ) -> None:
        """Run callbacks, or ``once`` one, until the deadline has passed or the condition is true."""
        thread, outer = threading.get_ident(), self._rclpy_spinning_thread
        if outer is not None and outer != thread:
            raise ValueError("another thread already spins this executor")
        self._rclpy_spinning_thread = thread  # it may already be, if a callback spins
        try:
            if self._rclpy_overrides("wait_for_ready_callbacks"):
                end = self._rclpy_work_of_user(deadline, condition)
            else:
                self._rclpy_take_back_offers()
                end = self._rclpy_work(self._rclpy_handle, deadline, condition, once=once)
            if end is not None and end not in self._rclpy_spin_ends:
                raise end
        finally:
            self._rclpy_spinning_thread = self._rclpy_callback_thread = outer
            self._rclpy_changed = True  # perhaps for an outer call
            if self._is_shutdown:  # shutdown() may be waiting for this
                with self._rclpy_idle:
                    self._rclpy_idle.notify_all()

    def _rclpy_overrides(self, *methods: str) -> bool:
        """Whether a user's class has one of these methods of its own."""
        return any(getattr(type(self), name) is not getattr(_BuiltInExecutor, name) for name in methods)

    def _rclpy_work_of_user(
        self, deadline: int | None, condition: Callable[[], bool] | None
    ) -> type[Exception] | None:
        """Do one piece of work that the user's class has selected; return the reason to end."""
        timeout = None if deadline is None else _remaining(deadline) / S_TO_NS
        try:
            task, _, _ = self.wait_for_ready_callbacks(timeout, None, condition or (lambda: False))
        except _ENDS as end:
            return type(end)
        self._rclpy_handle(task)
        return None

    def _rclpy_handle(self, entity: Any) -> bool:
        """Run a task or the callback of a ready entity, here or on another thread; return whether it does."""
        raise NotImplementedError


class SingleThreadedExecutor(_BuiltInExecutor):
    """Runs all callbacks on the thread that spins."""

    def _rclpy_handle(self, entity: Any) -> bool:
        """Do what :meth:`_begin` and :meth:`_run` do, in one step: every message takes this path."""
        if entity.__class__ is Task:
            self._rclpy_callback_thread = self._rclpy_spinning_thread
            self._rclpy_run(entity, None)
            self._rclpy_callback_thread = None
            return True
        group = entity.callback_group
        if group is not None and not group.beginning_execution(entity):
            self._rclpy_block(entity)
            return False
        self._rclpy_callback_thread = self._rclpy_spinning_thread
        try:
            taken = entity._rclpy_take()
            result = None if taken is None else entity._rclpy_execute(taken)
        except BaseException:
            self._rclpy_end_execution(entity)
            raise
        if result.__class__ is CoroutineType:
            self._rclpy_run_coroutine(entity, result)
        elif group is not None:
            group.ending_execution(entity)
            if self._rclpy_blocked:
                self._rclpy_groups_changed = self._rclpy_changed = True
        self._rclpy_callback_thread = None
        return taken is not None


class MultiThreadedExecutor(_BuiltInExecutor):
    """Runs callbacks on a pool of threads, in parallel if their callback groups allow it."""

    _rclpy_spin_ends = _BuiltInExecutor._rclpy_spin_ends | {ExternalShutdownException}  # as in rclpy

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        """Create ``num_threads`` threads, by default one per processor, at least two. Raises ValueError."""
        if num_threads is not None and num_threads < 1:
            raise ValueError("a MultiThreadedExecutor needs at least one thread")
        from concurrent.futures import ThreadPoolExecutor  # here: it takes long to import

        super().__init__(context=context)
        self._rclpy_threads = num_threads or max(2, os.cpu_count() or 2)
        self._rclpy_pool_threads = pool_threads = set[int]()
        self._rclpy_pool = ThreadPoolExecutor(
            self._rclpy_threads,
            "rclpy-executor",
            # Without self: the threads must not keep the executor alive.
            lambda: pool_threads.add(threading.get_ident()),
        )
        self._rclpy_errors: deque[BaseException] = deque()
        self._rclpy_in_pool = 0  # running or queued callbacks
        self._rclpy_wake_set = _dds.WaitSet()  # contains the guard condition only
        self._rclpy_wake_set.attach(self._guard.handle, WAKE)
        self._rclpy_dds.append(self._rclpy_wake_set)

    def _rclpy_work(
        self,
        handle: Callable[[Any], bool],
        deadline: int | None,
        condition: Callable[[], bool] | None,
        *,
        once: bool = False,
    ) -> type[Exception] | None:
        """Wait for a free thread before any work: samples taken earlier would pile up and get old."""
        while True:
            while self._rclpy_in_pool >= self._rclpy_threads:
                if (end := self._rclpy_reason_to_end(condition)) is not None:
                    return end
                timeout = _remaining(deadline)
                if not timeout:
                    return TimeoutException
                if self._rclpy_wake_set.wait(timeout):
                    self._guard.take()
            end = super()._rclpy_work(handle, deadline, condition, once=True)
            if once or end is not None or not _remaining(deadline):
                return end

    def _rclpy_spin(
        self, deadline: int | None, condition: Callable[[], bool] | None, *, once: bool = False
    ) -> None:
        try:
            super()._rclpy_spin(
                deadline,
                lambda: bool(self._rclpy_errors) or (condition is not None and condition()),
                once=once,
            )
        finally:
            if self._rclpy_closed:
                self._rclpy_pool.shutdown(wait=False)
        if self._rclpy_errors:
            raise self._rclpy_errors.popleft()

    def _rclpy_handle(self, entity: Any) -> bool:
        taken = self._rclpy_begin(entity)
        if taken is None:
            return False
        with self._rclpy_idle:
            self._rclpy_in_pool += 1
        try:
            self._rclpy_pool.submit(self._rclpy_run_in_pool, entity, taken)
        except RuntimeError:  # the interpreter ends
            self._rclpy_run_in_pool(entity, taken)
        return True

    def _rclpy_run_in_pool(self, entity: Any, taken: Any) -> None:
        try:
            self._rclpy_run(entity, taken)
        except BaseException as error:
            self._rclpy_errors.append(error)
        finally:
            with self._rclpy_idle:
                self._rclpy_in_pool -= 1
                self._rclpy_idle.notify_all()
                # The spinning thread may wait for a free thread, this entity's callback group, or an error.
                # Under the lock, because shutdown() waits for it and then closes the guard condition.
                self.wake()

    def _rclpy_is_idle(self) -> bool:
        return super()._rclpy_is_idle() and not self._rclpy_in_pool

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop, and wait until callbacks have ended, unless one calls this: see :meth:`Executor.shutdown`."""
        if threading.get_ident() in self._rclpy_pool_threads:
            timeout_sec = 0  # a callback cannot wait for its own end
        return super().shutdown(timeout_sec)

    def _rclpy_close(self) -> None:
        super()._rclpy_close()
        # A signal handler may have interrupted the pool, which holds its lock then: the spinning ends soon.
        if threading.get_ident() != self._rclpy_spinning_thread:
            self._rclpy_pool.shutdown(wait=False)
