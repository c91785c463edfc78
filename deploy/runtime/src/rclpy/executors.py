"""Executors: they wait for events of nodes and run the callbacks.

An executor waits in a DDS wait set, with the interpreter lock released. The wait set has a condition for each
reader, and a guard condition for all other changes: timers, tasks, guard conditions, created and destroyed
entities. So no executor polls, and a change from any thread takes effect at once. Only the spinning thread
uses the wait set; other threads set a flag and trigger the guard condition. Every message takes the path
between two waits, so this path looks at one flag only.
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
from types import CoroutineType, TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from rclpy import _dds, signals
from rclpy._dds import INFINITY
from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client  # noqa: F401 (re-export)
from rclpy.constants import S_TO_NS
from rclpy.exceptions import InvalidHandle, NotInitializedException  # noqa: F401 (re-export)
from rclpy.guard_condition import GuardCondition  # noqa: F401 (re-export)
from rclpy.task import Future, Task
from rclpy.utilities import get_default_context

if TYPE_CHECKING:
    from rclpy._wait_set import WaitableWatch
    from rclpy.context import Context
    from rclpy.node import Node
    from rclpy.timer import Timer
    from rclpy.waitable import Waitable

# In a flood, ready readers take further messages in turn for this long [ns]. Then timers are checked again.
# So a flood of messages needs few waits, and a slow callback delays the others only by its own duration.
_BURST = 200_000
# A wait that begins this soon [ns] after the last one or its burst belongs to a flood. After a longer break,
# a second look at a reader would find nothing.
_BREAK = 50_000
_WAKE = 0  # the wait set's token of the guard condition


class TimeoutException(Exception):
    """Raised when no callback became ready in time."""


class ShutdownException(Exception):
    """Raised when the executor was shut down."""


class ExternalShutdownException(Exception):
    """Context has been shutdown."""

    def __init__(self, *args: object) -> None:
        super().__init__(*(args or ("the context was shut down by a signal or another thread",)))


class ConditionReachedException(Exception):
    """Future has been completed."""


class TimeoutObject:
    """A timeout for several calls together."""

    def __init__(self, timeout: float) -> None:
        self._deadline = _deadline(timeout)

    @property
    def timeout(self) -> float:
        """Remaining time [s], never negative; -1: no timeout."""
        if self._deadline is None:
            return -1.0
        return _remaining(self._deadline) / S_TO_NS


def _deadline(timeout: float | TimeoutObject | None) -> int | None:
    """Convert a timeout [s] to a deadline of the steady clock [ns]; ``None``: no deadline."""
    if isinstance(timeout, TimeoutObject):
        return timeout._deadline
    if timeout is None or timeout < 0:
        return None
    return time.monotonic_ns() + int(timeout * S_TO_NS)


def _remaining(deadline: int | None) -> int:
    """Return the time until a deadline [ns], never negative."""
    return INFINITY if deadline is None else max(0, deadline - time.monotonic_ns())


class _Entity(Protocol):
    """An entity with a callback: subscription, timer, service, client, guard condition or events."""

    @property
    def callback_group(self) -> CallbackGroup | None: ...

    def _take(self) -> Any: ...

    def _execute(self, taken: Any) -> Any: ...


async def await_or_execute(callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any) -> Any:
    """Call ``callback``; if it is a coroutine function, await its result."""
    if inspect.iscoroutinefunction(callback):
        return await callback(*args)
    assert callable(callback)
    return callback(*args)


class Executor(AbstractContextManager["Executor"]):
    """Waits for ready callbacks of its nodes. Subclasses decide how and on which thread they run."""

    def __init__(self, *, context: Context | None = None) -> None:
        """Create an executor. Raises NotInitializedException if the context does not run."""
        super().__init__()
        self._context = get_default_context() if context is None else context
        if not self._context._valid:
            raise NotInitializedException
        self._nodes: list[Node] = []
        self._nodes_lock = threading.RLock()
        self._tasks: deque[Task] = deque()
        self._is_shutdown = False
        self._is_global = False  # the default of rclpy.spin(), which returns silently after rclpy.shutdown()
        self._closed = False
        self._idle = threading.Condition()

        self._guard = _dds.GuardCondition()
        self._waitset = _dds.WaitSet()
        self._waitset.attach(self._guard.handle, _WAKE)
        # Closed with the executor, also if it is garbage-collected without a shutdown.
        self._dds: list[_dds.WaitSet | _dds.GuardCondition] = [self._waitset, self._guard]
        self._close_dds = weakref.finalize(self, _close, self._dds)
        self._close_dds.atexit = False  # at exit, DDS closes everything itself
        self._spinning_thread: int | None = None
        self._callback_thread: int | None = None  # the spinning thread, while it runs a callback
        # Only the spinning thread uses the rest, except these three flags.
        self._changed = True  # anything but data and time: one of the others, or a reason to end
        self._entities_changed = True
        self._groups_changed = False
        self._only_nodes: list[Node] | None = None  # if given, wait for these instead of the added ones
        self._seen: list[tuple[Node, int]] = []  # nodes in the wait set, with the version of their entities
        self._timers: list[Timer] = []
        self._guards: list[Any] = []
        self._watch: WaitableWatch | None = None  # if nodes have waitables of users
        self._attached: dict[int, tuple[_Entity, int]] = {}  # token -> entity, DDS handle
        self._blocked: dict[int, tuple[_Entity, int]] = {}  # likewise, while the callback group is busy
        self._tokens: dict[int, int] = {}  # DDS handle -> token
        self._last_token = _WAKE
        # Entities or tasks. A reader may have several messages: with its DDS handle, the others with 0.
        self._ready: deque[tuple[Any, int]] = deque()
        self._repeatable: deque[tuple[Any, int]] = deque()  # readers that had a message in this burst
        self._burst_end = 0
        self._flood_end = 0
        self._tasks_were_first = False
        self._context._executors.add(self)
        signals._watch(self)

    @property
    def context(self) -> Context:
        """The context of the executor."""
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
        self._entities_have_changed()
        return True

    def remove_node(self, node: Node) -> None:
        """Remove a node: this executor stops running its callbacks."""
        with self._nodes_lock:
            if node not in self._nodes:
                return
            self._nodes.remove(node)
        self._entities_have_changed()

    def get_nodes(self) -> list[Node]:
        """Return the nodes of this executor."""
        with self._nodes_lock:
            return list(self._nodes)

    def _entities_have_changed(self) -> None:
        self._entities_changed = True
        self._wake_if_waiting()

    # Tasks

    def create_task(
        self, callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any, **kwargs: Any
    ) -> Task:
        """Run a function or coroutine on this executor; return its task, a future of the result."""
        task = Task(callback, args, kwargs, executor=self)
        self._schedule(task)
        return task

    def _schedule(self, task: Task) -> None:
        self._tasks.append(task)
        self._wake_if_waiting()

    def _run_task(self, task: Task) -> None:
        task()
        if task.done() or task.cancelled():
            return
        awaited = task._awaited
        if awaited is None:
            self._schedule(task)
        else:
            awaited._call_when_complete(lambda: self._schedule(task))

    # Spinning

    def wake(self) -> None:
        """Make the spinning thread check for work again; may be called from any thread."""
        self._changed = True
        if not self._is_shutdown:
            self._guard.trigger()

    def _wake_if_waiting(self) -> None:
        """Wake the spinning thread, unless it is running the caller and will check again anyway."""
        if threading.get_ident() == self._callback_thread:
            self._changed = True
        else:
            self.wake()

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        while self._context._valid and not self._is_shutdown:
            self.spin_once()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Run one callback; wait for it at most ``timeout_sec`` (``None`` or negative: for ever).

        Custom executors implement this with :meth:`wait_for_ready_callbacks`.
        """
        raise NotImplementedError

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until ``future`` is done or cancelled, at most for ``timeout_sec``."""
        future._call_when_complete(self.wake)
        timeout = None if timeout_sec is None or timeout_sec < 0 else TimeoutObject(timeout_sec)
        while self._context._valid and not self._is_shutdown and not future._is_over():
            self.spin_once_until_future_complete(future, timeout)
            if timeout is not None and not timeout.timeout:
                return

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        """
        Run one callback, unless ``future`` is done before one is ready.

        Custom executors that support :meth:`spin_until_future_complete` implement this.
        """
        raise NotImplementedError

    def wait_for_ready_callbacks(
        self,
        timeout_sec: float | TimeoutObject | None = None,
        nodes: list[Node] | None = None,
        condition: Callable[[], bool] = lambda: False,
    ) -> tuple[Task, Any, Node | None]:
        """
        Wait for a ready callback and return it as a task, with its entity and node.

        :param nodes: wait for callbacks of these nodes; ``None``: those of this executor.
        :raises TimeoutException, ShutdownException, ExternalShutdownException, ConditionReachedException:
            if the wait ends without one.
        """
        if nodes is not None:
            self._wait_only_for(list(nodes))
        found: list[tuple[Any, Any]] = []

        def keep(entity: Any) -> bool:
            taken = self._begin(entity)
            if taken is not None:
                found.append((entity, taken))
            return taken is not None

        try:
            end = self._work(keep, _deadline(timeout_sec), condition, once=True)
        finally:
            if nodes is not None:
                self._wait_only_for(None)
        if end is not None:
            raise end
        entity, taken = found[0]
        task = Task(self._run, (entity, taken), executor=self)
        entity = getattr(entity, "waitable", entity)
        candidates = self.get_nodes() if nodes is None else nodes
        node = next((node for node in candidates if entity in node._rclpy_entities()), None)
        # When the task ends, its callback group may allow other callbacks, for which another thread may wait.
        task._call_when_complete(self.wake)
        return task, entity, node

    def _wait_only_for(self, nodes: list[Node] | None) -> None:
        self._only_nodes = nodes
        self._entities_changed = True

    def can_execute(self, entity: Any) -> bool:
        """Return whether the callback group of ``entity`` allows it to run now."""
        return entity.callback_group is None or bool(entity.callback_group.can_execute(entity))

    def _work(
        self,
        handle: Callable[[Any], bool],
        deadline: int | None,
        condition: Callable[[], bool] | None,
        *,
        once: bool = False,
    ) -> type[Exception] | None:
        """
        Wait for work and hand it on, until the deadline has passed or there is another reason to end.

        :param handle: gets a ready entity or task; returns whether there was work to do.
        :param condition: whether the caller wants the end; asked at first, and after each :meth:`wake`.
        :param once: return after one piece of work.
        :return: the reason to end; ``None`` after work.
        """
        ready, repeatable = self._ready, self._repeatable
        self._changed = True  # whatever has happened meanwhile
        if self._blocked:  # another executor may have freed a callback group
            self._groups_changed = True
        waited = False
        while True:
            if self._changed and (end := self._handle_changes(condition)) is not None:
                return end
            if ready:
                entity, reader = ready.popleft()
                if handle(entity):
                    if reader and self._burst_end:
                        repeatable.append((entity, reader))
                    if once or (self._changed and not self._context._valid):
                        return None
                    if deadline is not None and time.monotonic_ns() >= deadline:
                        return None
                del entity  # the next wait may be long: keep no object alive
            elif repeatable and time.monotonic_ns() < self._burst_end:
                ready.extend(repeatable)
                repeatable.clear()
            else:
                if waited and deadline is not None and time.monotonic_ns() >= deadline:
                    return TimeoutException
                repeatable.clear()
                self._collect(deadline)
                waited = True

    def _handle_changes(self, condition: Callable[[], bool] | None) -> type[Exception] | None:
        """Handle what callbacks and other threads have changed; return the reason to end the wait, if any."""
        self._changed = False  # first: later changes are handled in the next round
        if (end := self._reason_to_end(condition)) is not None:
            return end
        if self._entities_changed:
            self._update_entities()
        if self._groups_changed:
            self._unblock()
        return None

    def _reason_to_end(self, condition: Callable[[], bool] | None) -> type[Exception] | None:
        """Return the exception that tells why to end the wait for work, if there is a reason."""
        if self._is_shutdown or not self._context._valid:
            in_order = not self._context._ended_by_signal if self._is_global else self._is_shutdown
            return ShutdownException if in_order else ExternalShutdownException
        if condition is not None and condition():
            return ConditionReachedException
        return None

    def _begin(self, entity: Any) -> Any:
        """Take the data of a ready entity; ``None`` if its callback must not run."""
        if entity.__class__ is Task:
            return ()
        group = entity.callback_group
        if group is not None and not group.beginning_execution(entity):
            self._block(entity)
            return None
        try:
            taken = entity._take()
        except BaseException:
            self._end_execution(entity)
            raise
        if taken is None and group is not None:
            group.ending_execution(entity)
        return taken

    def _collect(self, deadline: int | None) -> None:
        """Wait for ready entities until the deadline has passed or :meth:`wake` is called; collect them."""
        now = time.monotonic_ns()
        timeout = INFINITY if deadline is None else deadline - now if deadline > now else 0
        if self._tasks:
            self._tasks_were_first = not self._tasks_were_first
            if self._tasks_were_first:  # as in rclpy; the next time, they come after the data
                self._collect_tasks()
                return
            timeout = 0
        for guard in self._guards:
            if guard._is_ready() and self.can_execute(guard):
                timeout = 0
                self._ready.append((guard, 0))
        next_timer: Timer | None = None
        for timer in self._timers:
            if timer._canceled:  # most timers of schedulers are: saves the call
                continue
            remaining = timer._next_call - now if timer._is_steady else timer._remaining()
            if remaining <= 0:
                if self.can_execute(timer):
                    next_timer, timeout = None, 0
                    self._ready.append((timer, 0))
            elif remaining < timeout:
                next_timer, timeout = timer, remaining
        watch = self._watch
        if watch is not None and (remaining := watch.prepare()) < timeout:
            next_timer, timeout = None, remaining
        tokens = self._waitset.wait(timeout)
        if tokens:
            self._burst_end = now + _BURST if now < self._flood_end else 0
            self._flood_end = (self._burst_end or now) + _BREAK
            if len(tokens) > 1:
                tokens.sort()  # subscriptions before services and clients, as in rclpy
            for token in tokens:
                if token == _WAKE:
                    self._guard.take()
                elif (attached := self._attached.get(token)) is not None:
                    self._ready.append(attached)
        elif next_timer is not None:
            self._ready.append((next_timer, 0))  # the wait lasted until the timer was due
        if watch is not None:
            self._ready.extend((entity, 0) for entity in watch.ready(tokens))
        if self._tasks:
            self._collect_tasks()

    def _collect_tasks(self) -> None:
        while self._tasks:
            self._ready.append((self._tasks.popleft(), 0))

    # The contents of the wait set

    def _update_entities(self) -> None:
        """Update the wait set to the current entities of the nodes."""
        self._entities_changed = False  # first: later changes are handled in the next round
        nodes = self.get_nodes() if self._only_nodes is None else self._only_nodes
        seen = [(node, node._rclpy_entities_version) for node in nodes]
        if seen == self._seen:
            return  # rclpy.spin_once() adds and removes its node with every call
        self._seen = seen
        self._timers, self._guards = [], []
        wanted: dict[int, _Entity] = {}
        waitables: list[Waitable] = []
        for node in nodes:
            self._timers.extend(node.timers)
            self._guards.extend(node.guards)
            waitables.extend(node._rclpy_added_waitables)
            for entity in node._rclpy_waitables():
                self._timers.extend(getattr(entity, "_timers", ()))
                for handle in entity._handles:
                    wanted[handle] = entity
        for handle in [handle for handle in self._tokens if handle not in wanted]:
            token = self._tokens.pop(handle)
            if self._attached.pop(token, None) is not None:
                self._waitset.detach(handle)
            self._blocked.pop(token, None)
        for handle, entity in wanted.items():
            if handle not in self._tokens:
                self._last_token += 1
                if self._waitset.attach(handle, self._last_token):
                    self._tokens[handle] = self._last_token
                    self._attached[self._last_token] = (entity, handle)
        self._update_waitables(waitables)
        self._repeatable.clear()
        if self._ready:  # drop entities of nodes that were removed or destroyed
            present = {*self._timers, *self._guards, *wanted.values()}
            if self._watch is not None:
                present.update(self._watch.entities)
            left = [one for one in self._ready if one[0].__class__ is Task or one[0] in present]
            self._ready.clear()
            self._ready.extend(left)

    def _update_waitables(self, waitables: list[Waitable]) -> None:
        """Update what the waitables of users wait for."""
        if self._watch is None and waitables:
            from rclpy._wait_set import WaitableWatch  # here: few programs have waitables

            self._watch = WaitableWatch(self)
        if self._watch is not None:
            self._watch.update(waitables)

    def _block(self, entity: _Entity) -> None:
        """Stop waiting for an entity whose callback group is busy: its data would end every wait at once."""
        if self._watch is not None and entity in self._watch.entities:
            self._watch.postpone(entity)
        for token, (attached, handle) in list(self._attached.items()):
            if attached is entity:
                del self._attached[token]
                self._waitset.detach(handle)
                self._blocked[token] = (entity, handle)
        # Never set to False here: another thread may just have freed the group and set it.
        if self.can_execute(entity):
            self._groups_changed = self._changed = True

    def _unblock(self) -> None:
        """Wait again for entities whose callback group is free again."""
        self._groups_changed = False
        for token, (entity, handle) in list(self._blocked.items()):
            if self.can_execute(entity):
                del self._blocked[token]
                if self._waitset.attach(handle, token):
                    self._attached[token] = (entity, handle)

    # Running

    def _run(self, entity: Any, taken: Any) -> None:
        """Run a task, or the callback of an entity with the data; exceptions of the callback propagate."""
        if entity.__class__ is Task:
            self._run_task(entity)
            _raise_exception_of(entity)
            return
        try:
            result = entity._execute(taken)
        except BaseException:
            self._end_execution(entity)
            raise
        if result.__class__ is CoroutineType:
            self._run_coroutine(entity, result)
        else:
            self._end_execution(entity)

    def _run_coroutine(self, entity: Any, coroutine: Any) -> None:
        """Run what a callback has returned; its callback group is busy until the coroutine ends."""
        task = Task(coroutine, executor=self)
        task._call_when_complete(lambda: self._end_execution(entity))
        self._run_task(task)
        _raise_exception_of(task)

    def _end_execution(self, entity: _Entity) -> None:
        if entity.callback_group is not None:
            entity.callback_group.ending_execution(entity)
            if self._blocked:
                self._groups_changed = self._changed = True

    def _is_idle(self) -> bool:
        """Whether no thread spins or runs a callback."""
        return self._spinning_thread is None

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """
        Stop, and wait until callbacks on other threads have ended.

        :return: whether they ended within ``timeout_sec`` (``None``: no limit).
        """
        if not self._is_shutdown:
            self._is_shutdown = self._changed = True
            self._guard.trigger()
        # A callback or signal handler on the spinning thread cannot wait for its own end.
        if threading.get_ident() != self._spinning_thread:
            with self._idle:
                if not self._idle.wait_for(self._is_idle, timeout_sec):
                    return False
        if not self._closed:
            self._closed = True
            for node in self.get_nodes():
                self.remove_node(node)
                node.executor = None
            self._context._executors.discard(self)
            self._close()
        return True

    def _close(self) -> None:
        self._close_dds()

    def __enter__(self) -> Executor:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        self.shutdown()


def _close(entities: list[_dds.WaitSet | _dds.GuardCondition]) -> None:
    for entity in entities:
        entity.close()


def _raise_exception_of(task: Task) -> None:
    if task.done() and task.exception() is not None:
        task.result()


class _BuiltInExecutor(Executor):
    """Base of this module's executors, with a minimum of code between waiting and callback."""

    _SPIN_ENDS: tuple[type[Exception], ...] = (TimeoutException, ShutdownException, ConditionReachedException)
    """These end the spinning without an error."""

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        if type(self).spin_once is not _BuiltInExecutor.spin_once:
            super().spin()  # a user's class has a spin_once() of its own
            return
        while self._context._valid and not self._is_shutdown:
            self._spin(None, None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback; wait for it at most ``timeout_sec`` (``None`` or negative: for ever)."""
        self._spin(_deadline(timeout_sec), None, once=True)

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        """Run one callback, unless ``future`` is done before one is ready."""
        future._call_when_complete(self.wake)
        self._spin(_deadline(timeout_sec), future._is_over, once=True)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until ``future`` is done or cancelled, at most for ``timeout_sec``."""
        future._call_when_complete(self.wake)
        if self._context._valid:
            self._spin(_deadline(timeout_sec), future._is_over)

    def _spin(
        self, deadline: int | None, condition: Callable[[], bool] | None, *, once: bool = False
    ) -> None:
        """Run callbacks, or ``once`` one, until the deadline has passed or the condition is true."""
        thread, outer = threading.get_ident(), self._spinning_thread
        if outer is not None and outer != thread:
            raise ValueError("another thread already spins this executor")
        self._spinning_thread = thread  # it may already be, if a callback spins
        try:
            end = self._work(self._handle, deadline, condition, once=once)
            if end is not None and end not in self._SPIN_ENDS:
                raise end
        finally:
            self._spinning_thread = self._callback_thread = outer
            self._changed = True  # perhaps for an outer call
            if self._is_shutdown:  # shutdown() may be waiting for this
                with self._idle:
                    self._idle.notify_all()

    def _handle(self, entity: Any) -> bool:
        """Run a task or the callback of a ready entity, here or on another thread; return whether it does."""
        raise NotImplementedError


class SingleThreadedExecutor(_BuiltInExecutor):
    """Runs all callbacks on the thread that spins."""

    def _handle(self, entity: Any) -> bool:
        """Do what :meth:`_begin` and :meth:`_run` do, in one step: every message takes this path."""
        if entity.__class__ is Task:
            self._callback_thread = self._spinning_thread
            self._run(entity, None)
            self._callback_thread = None
            return True
        group = entity.callback_group
        if group is not None and not group.beginning_execution(entity):
            self._block(entity)
            return False
        self._callback_thread = self._spinning_thread
        try:
            taken = entity._take()
            result = None if taken is None else entity._execute(taken)
        except BaseException:
            self._end_execution(entity)
            raise
        if result.__class__ is CoroutineType:
            self._run_coroutine(entity, result)
        elif group is not None:
            group.ending_execution(entity)
            if self._blocked:
                self._groups_changed = self._changed = True
        self._callback_thread = None
        return taken is not None


class MultiThreadedExecutor(_BuiltInExecutor):
    """Runs callbacks on a pool of threads, in parallel if their callback groups allow it."""

    _SPIN_ENDS = (
        *_BuiltInExecutor._SPIN_ENDS,
        ExternalShutdownException,
    )  # as in rclpy

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        """
        Create an executor with ``num_threads`` threads, by default one per processor and at least two.

        :raises ValueError: if ``num_threads`` is less than one.
        """
        if num_threads is not None and num_threads < 1:
            raise ValueError("a MultiThreadedExecutor needs at least one thread")
        from concurrent.futures import ThreadPoolExecutor  # here: it takes long to import

        super().__init__(context=context)
        self._threads = num_threads or max(2, os.cpu_count() or 2)
        self._pool_threads = pool_threads = set[int]()
        self._pool = ThreadPoolExecutor(
            self._threads,
            "rclpy-executor",
            lambda: pool_threads.add(
                threading.get_ident()
            ),  # without self: the threads must not keep the executor alive
        )
        self._errors: deque[BaseException] = deque()
        self._in_pool = 0  # running or queued callbacks
        self._wake_set = _dds.WaitSet()  # contains the guard condition only
        self._wake_set.attach(self._guard.handle, _WAKE)
        self._dds.append(self._wake_set)

    def _work(
        self,
        handle: Callable[[Any], bool],
        deadline: int | None,
        condition: Callable[[], bool] | None,
        *,
        once: bool = False,
    ) -> type[Exception] | None:
        """Wait for a free thread before any work: samples taken earlier would pile up and get old."""
        while True:
            while self._in_pool >= self._threads:
                if (end := self._reason_to_end(condition)) is not None:
                    return end
                timeout = _remaining(deadline)
                if not timeout:
                    return TimeoutException
                if self._wake_set.wait(timeout):
                    self._guard.take()
            end = super()._work(handle, deadline, condition, once=True)
            if once or end is not None or not _remaining(deadline):
                return end

    def _spin(
        self, deadline: int | None, condition: Callable[[], bool] | None, *, once: bool = False
    ) -> None:
        try:
            super()._spin(
                deadline, lambda: bool(self._errors) or (condition is not None and condition()), once=once
            )
        finally:
            if self._closed:
                self._pool.shutdown(wait=False)
        if self._errors:
            raise self._errors.popleft()

    def _handle(self, entity: Any) -> bool:
        taken = self._begin(entity)
        if taken is None:
            return False
        with self._idle:
            self._in_pool += 1
        try:
            self._pool.submit(self._run_in_pool, entity, taken)
        except RuntimeError:  # the interpreter ends
            self._run_in_pool(entity, taken)
        return True

    def _run_in_pool(self, entity: Any, taken: Any) -> None:
        try:
            self._run(entity, taken)
        except BaseException as error:
            self._errors.append(error)
        finally:
            with self._idle:
                self._in_pool -= 1
                self._idle.notify_all()
                # The spinning thread may wait for a free thread, this entity's callback group, or an error.
                # Under the lock, because shutdown() waits for it and then closes the guard condition.
                self.wake()

    def _is_idle(self) -> bool:
        return super()._is_idle() and not self._in_pool

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop, and wait until callbacks have ended, unless one calls this: see :meth:`Executor.shutdown`."""
        if threading.get_ident() in self._pool_threads:
            timeout_sec = 0  # a callback cannot wait for its own end
        return super().shutdown(timeout_sec)

    def _close(self) -> None:
        super()._close()
        # A signal handler may have interrupted the pool, which holds its lock then: the spinning ends soon.
        if threading.get_ident() != self._spinning_thread:
            self._pool.shutdown(wait=False)
