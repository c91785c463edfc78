"""Executors: they wait for what happens to nodes and run the callbacks.

An executor waits in a DDS wait set, with the interpreter lock released, on one condition per reader and on
one guard condition by which everything else wakes it: timers that changed, tasks, guard conditions, entities
that came or went. So nothing polls, and a change from any thread is seen at once. The wait set belongs to the
spinning thread alone: other threads only leave word and wake it.
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
from rclpy._dds import INFINITY, WaitSet
from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client  # noqa: F401 (public programs import it from here)
from rclpy.constants import S_TO_NS
from rclpy.exceptions import InvalidHandle, NotInitializedException  # noqa: F401 (public programs import InvalidHandle from here)
from rclpy.guard_condition import GuardCondition  # noqa: F401 (public programs import it from here)
from rclpy.task import Future, Task
from rclpy.utilities import get_default_context

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node
    from rclpy.timer import Timer

# As long as all that was ready is run within this time, readers may have more messages at once, in turns;
# then the timers get theirs. So a flood costs few waits, and a slow callback delays nobody but by itself.
_TURNS = 200_000  # ns
_WAKE = 0  # the wait set's token of the guard condition


class TimeoutException(Exception):
    """Signal that nothing became ready in time."""


class ShutdownException(Exception):
    """Signal that the executor was shut down."""


class ExternalShutdownException(Exception):
    """Context has been shutdown."""

    def __init__(self, *args: object) -> None:
        super().__init__(
            *(args or ("the context was shut down from outside: by a signal or another thread",))
        )


class ConditionReachedException(Exception):
    """Future has been completed."""


class TimeoutObject:
    """A timeout that many calls share."""

    def __init__(self, timeout: float) -> None:
        self._deadline = _deadline(timeout)

    @property
    def timeout(self) -> float:
        """Seconds that remain, never negative; -1 for no end."""
        if self._deadline is None:
            return -1.0
        return _remaining(self._deadline) / S_TO_NS


def _deadline(timeout: float | TimeoutObject | None) -> int | None:
    """When a timeout [s] is over, by the steady clock [ns]; ``None`` for never."""
    if isinstance(timeout, TimeoutObject):
        return timeout._deadline
    if timeout is None or timeout < 0:
        return None
    return time.monotonic_ns() + int(timeout * S_TO_NS)


def _remaining(deadline: int | None) -> int:
    """Nanoseconds until a deadline of :func:`_deadline`, never negative."""
    return INFINITY if deadline is None else max(0, deadline - time.monotonic_ns())


class _Entity(Protocol):
    """What an executor waits for and runs: a subscription, timer, service, client, guard or event."""

    @property
    def callback_group(self) -> CallbackGroup | None: ...

    def _take(self) -> Any: ...

    def _execute(self, taken: Any) -> Any: ...


async def await_or_execute(callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any) -> Any:
    """Call ``callback``; await what it returns if it is a coroutine function."""
    if inspect.iscoroutinefunction(callback):
        return await callback(*args)
    assert callable(callback)
    return callback(*args)


class Executor(AbstractContextManager["Executor"]):
    """Waits for work of its nodes. What runs it, and on which thread, is up to the subclasses."""

    def __init__(self, *, context: Context | None = None) -> None:
        """Create an executor of ``context``'s nodes. Raises NotInitializedException if it does not run."""
        super().__init__()
        self._context = get_default_context() if context is None else context
        if not self._context._valid:
            raise NotInitializedException
        self._nodes: list[Node] = []
        self._nodes_lock = threading.RLock()
        self._tasks: deque[Task] = deque()
        self._is_shutdown = False
        self._is_global = False  # rclpy.spin()'s: unless a signal ends the context, spinning just returns
        self._closed = False
        self._idle = threading.Condition()

        self._guard = _dds.GuardCondition()
        self._waitset = WaitSet()
        self._waitset.attach(self._guard.handle, _WAKE)
        # What ends with the executor, also where nobody shuts it down.
        self._dds: list[WaitSet | _dds.GuardCondition] = [self._waitset, self._guard]
        self._close_dds = weakref.finalize(self, _close, self._dds)
        self._close_dds.atexit = False  # DDS ends by itself then
        self._spinning_thread: int | None = None
        self._callback_thread: int | None = None  # the spinning thread, while it runs a callback itself
        # The rest is the spinning thread's own, but for the two flags by which others leave word.
        self._entities_changed = True
        self._groups_changed = False
        self._only_nodes: list[Node] | None = None  # to wait for, in place of those that were added
        self._seen: list[tuple[Node, int]] = []  # the nodes, and the version of their entities, waited for
        self._timers: list[Timer] = []
        self._guards: list[Any] = []
        self._attached: dict[int, tuple[_Entity, int]] = {}  # token -> entity, DDS handle
        self._blocked: dict[int, tuple[_Entity, int]] = {}  # the same, while their callback group is busy
        self._tokens: dict[int, int] = {}  # DDS handle -> token
        self._last_token = _WAKE
        # An entity or task, and whether it is a reader, which may have more than one message.
        self._ready: deque[tuple[Any, bool]] = deque()
        self._again: deque[tuple[Any, bool]] = deque()  # the readers that had one
        self._turns_end = 0
        self._context._executors.add(self)
        signals._watch(self)

    @property
    def context(self) -> Context:
        """The context whose nodes it runs."""
        return self._context

    # Nodes

    def add_node(self, node: Node) -> bool:
        """Run ``node``'s callbacks from now on. ``False`` if that is so already."""
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
        """Run ``node``'s callbacks no longer."""
        with self._nodes_lock:
            if node not in self._nodes:
                return
            self._nodes.remove(node)
        self._entities_have_changed()

    def get_nodes(self) -> list[Node]:
        """The nodes whose callbacks run here."""
        with self._nodes_lock:
            return list(self._nodes)

    def _entities_have_changed(self) -> None:
        self._entities_changed = True
        self._wake_if_waiting()

    # Tasks

    def create_task(
        self, callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any, **kwargs: Any
    ) -> Task:
        """Run a function or coroutine on this executor; the returned future gets its result."""
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
        """Let the spinning thread look anew; from any thread."""
        if not self._is_shutdown:
            self._guard.trigger()

    def _wake_if_waiting(self) -> None:
        """Wake, unless this is said in a callback on the spinning thread, which looks anew anyway."""
        if threading.get_ident() != self._callback_thread:
            self.wake()

    def spin(self) -> None:
        """Run callbacks until the context, or this executor, is shut down."""
        while self._context._valid and not self._is_shutdown:
            self.spin_once()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Run one callback, waiting at most ``timeout_sec`` for it (``None`` or negative: for ever).

        An executor of your own defines this, and gets its work from :meth:`wait_for_ready_callbacks`.
        """
        raise NotImplementedError

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until ``future`` is done or cancelled, but no longer than ``timeout_sec``."""
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
        Run one callback, unless ``future`` is or gets done before one is ready.

        An executor of your own defines this, if somebody is to wait for futures with it.
        """
        raise NotImplementedError

    def wait_for_ready_callbacks(
        self,
        timeout_sec: float | TimeoutObject | None = None,
        nodes: list[Node] | None = None,
        condition: Callable[[], bool] = lambda: False,
    ) -> tuple[Task, Any, Node | None]:
        """
        Wait for a callback and return it as a task, with its entity and node.

        :param nodes: the nodes whose callbacks to wait for; those of this executor if ``None``.
        :raises TimeoutException, ShutdownException, ExternalShutdownException, ConditionReachedException:
            if there is none.
        """
        if nodes is not None:
            self._wait_only_for(list(nodes))
        try:
            entity, taken = self._next(_deadline(timeout_sec), condition)
        finally:
            if nodes is not None:
                self._wait_only_for(None)
        candidates = self.get_nodes() if nodes is None else nodes
        node = next((node for node in candidates if entity in node._rclpy_entities()), None)
        task = Task(self._run, (entity, taken), executor=self)
        # Whoever waits here on another thread than the task's may have to wait for more from then on.
        task._call_when_complete(self.wake)
        return task, entity, node

    def _wait_only_for(self, nodes: list[Node] | None) -> None:
        self._only_nodes = nodes
        self._entities_changed = True

    def can_execute(self, entity: Any) -> bool:
        """Whether ``entity``'s callback group would let it run now."""
        return entity.callback_group is None or bool(entity.callback_group.can_execute(entity))

    def _next(self, deadline: int | None, condition: Callable[[], bool] | None) -> tuple[Any, Any]:
        """Wait for work: an entity and what was taken from it; for a task, the task and ``None``."""
        self._check(condition)
        waited = False
        while True:
            if self._entities_changed:
                self._update_entities()
            if self._groups_changed:
                self._unblock()
            while self._ready:
                entity, is_reader = self._ready.popleft()
                if entity.__class__ is Task:
                    return entity, None
                group = entity.callback_group
                if group is not None and not group.beginning_execution(entity):
                    self._block(entity)
                    continue
                try:
                    taken = entity._take()
                except BaseException:
                    self._ended(entity)
                    raise
                if taken is None:
                    if group is not None:
                        group.ending_execution(entity)
                    continue
                if is_reader:
                    self._again.append((entity, True))
                return entity, taken
            if self._again:
                if time.monotonic_ns() < self._turns_end:
                    self._ready, self._again = self._again, self._ready
                    continue
                self._again.clear()
            if waited and deadline is not None and time.monotonic_ns() >= deadline:
                raise TimeoutException
            # Without a word from anybody there is no new reason to end.
            if self._collect(deadline) or not self._ready:
                self._check(condition)
            waited = True

    def _check(self, condition: Callable[[], bool] | None) -> None:
        """Raise the reason for which no more work is to be waited for, if there is one."""
        if not self._context._valid:
            in_order = self._is_global and not self._context._ended_by_signal
            raise ShutdownException if in_order else ExternalShutdownException
        if self._is_shutdown:
            raise ShutdownException
        if condition is not None and condition():
            raise ConditionReachedException

    def _collect(self, deadline: int | None) -> bool:
        """
        Wait until something is ready, ``deadline`` is over or somebody wakes us; note what is ready.

        :return: whether somebody woke us.
        """
        timeout = _remaining(deadline)
        while self._tasks:
            timeout = 0
            self._ready.append((self._tasks.popleft(), False))
        for guard in self._guards:
            if guard._is_ready() and self.can_execute(guard):
                timeout = 0
                self._ready.append((guard, False))
        next_timer: Timer | None = None
        for timer in self._timers:
            remaining = timer._remaining()
            if remaining <= 0:
                if self.can_execute(timer):
                    next_timer, timeout = None, 0
                    self._ready.append((timer, False))
            elif remaining < timeout:
                next_timer, timeout = timer, remaining
        tokens = self._waitset.wait(timeout)
        if not tokens and next_timer is not None:
            self._ready.append((next_timer, False))  # its time has come
        if tokens:
            self._turns_end = time.monotonic_ns() + _TURNS
        woken = False
        for token in tokens:
            if token == _WAKE:
                woken = True
                self._guard.take()
            elif token in self._attached:
                self._ready.append((self._attached[token][0], True))
        return woken

    # What is waited for

    def _update_entities(self) -> None:
        """Bring the wait set up to the entities that the nodes have now."""
        self._entities_changed = False  # first: what changes from now on is seen in the next round
        nodes = self.get_nodes() if self._only_nodes is None else self._only_nodes
        seen = [(node, node._rclpy_entities_version) for node in nodes]
        if seen == self._seen:
            return  # rclpy.spin_once() adds and removes its node with every call
        self._seen = seen
        self._timers, self._guards = [], []
        wanted: dict[int, _Entity] = {}
        for node in nodes:
            self._timers.extend(node.timers)
            self._guards.extend(node.guards)
            for entity in node._rclpy_waitables():
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
        self._again.clear()
        if self._ready:  # what others run from now on is not run here
            here = {*self._timers, *self._guards, *wanted.values()}
            self._ready = deque(one for one in self._ready if one[0].__class__ is Task or one[0] in here)

    def _block(self, entity: _Entity) -> None:
        """Do not wait for an entity whose callback group is busy: its data would end every wait at once."""
        for token, (attached, handle) in list(self._attached.items()):
            if attached is entity:
                del self._attached[token]
                self._waitset.detach(handle)
                self._blocked[token] = (entity, handle)
        # Set or left alone: a thread that ends what is in the way meanwhile sets it, too.
        if self.can_execute(entity):
            self._groups_changed = True

    def _unblock(self) -> None:
        """Wait again for those whose callback group is free again."""
        self._groups_changed = False
        for token, (entity, handle) in list(self._blocked.items()):
            if self.can_execute(entity):
                del self._blocked[token]
                if self._waitset.attach(handle, token):
                    self._attached[token] = (entity, handle)

    # Running

    def _run(self, entity: Any, taken: Any) -> None:
        """Run what :meth:`_next` returned; raises what its callback raises."""
        if entity.__class__ is Task:
            self._run_task(entity)
            _raise_exception_of(entity)
            return
        try:
            result = entity._execute(taken)
        except BaseException:
            self._ended(entity)
            raise
        if result.__class__ is CoroutineType:
            task = Task(result, executor=self)
            task._call_when_complete(lambda: self._ended(entity))
            self._run_task(task)
            _raise_exception_of(task)
        else:
            self._ended(entity)

    def _ended(self, entity: _Entity) -> None:
        if entity.callback_group is not None:
            entity.callback_group.ending_execution(entity)
            if self._blocked:
                self._groups_changed = True

    def _is_idle(self) -> bool:
        """Whether no thread spins or runs a callback."""
        return self._spinning_thread is None

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """
        Stop, and wait for callbacks that run on other threads.

        :return: whether they ended within ``timeout_sec`` (``None``: however long it takes).
        """
        if not self._is_shutdown:
            self._is_shutdown = True
            self._guard.trigger()
        # A callback, or a signal handler, on the spinning thread cannot wait for itself to end.
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


def _close(entities: list[WaitSet | _dds.GuardCondition]) -> None:
    for entity in entities:
        entity.close()


def _raise_exception_of(task: Task) -> None:
    if task.done() and task.exception() is not None:
        task.result()


class _ReadyMadeExecutor(Executor):
    """An executor of this module: as little as possible stands between its waiting and a callback."""

    _ENDS: tuple[type[Exception], ...] = (TimeoutException, ShutdownException, ConditionReachedException)
    """what ends its spinning without an error"""

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback, waiting at most ``timeout_sec`` for it (``None`` or negative: for ever)."""
        self._spin(_deadline(timeout_sec), None, once=True)

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        """Run one callback, unless ``future`` is or gets done before one is ready."""
        future._call_when_complete(self.wake)
        self._spin(_deadline(timeout_sec), future._is_over, once=True)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until ``future`` is done or cancelled, but no longer than ``timeout_sec``."""
        future._call_when_complete(self.wake)
        if self._context._valid:
            self._spin(_deadline(timeout_sec), future._is_over)

    def _spin(
        self, deadline: int | None, condition: Callable[[], bool] | None, *, once: bool = False
    ) -> None:
        """Run callbacks, or one, unless the time is over or the condition true before one is ready."""
        thread, outer = threading.get_ident(), self._spinning_thread
        if outer is not None and outer != thread:
            raise ValueError("another thread spins this executor: it can only be spun by one at a time")
        self._spinning_thread = thread  # it may be that already, if it spins in a callback
        try:
            while True:
                self._callback_thread = None
                try:
                    entity, taken = self._next(deadline, condition)
                except self._ENDS:
                    return
                self._callback_thread = thread
                self._dispatch(entity, taken)
                if once or not self._context._valid:
                    return
                if deadline is not None and time.monotonic_ns() >= deadline:
                    return
                del entity, taken  # the next may be long in coming: nothing lives on for that
        finally:
            self._spinning_thread = self._callback_thread = outer
            if self._is_shutdown:  # somebody may be waiting for this; who comes later finds it done
                with self._idle:
                    self._idle.notify_all()

    def _dispatch(self, entity: Any, taken: Any) -> None:
        """Have run, here or elsewhere, what :meth:`_next` returned."""
        raise NotImplementedError


class SingleThreadedExecutor(_ReadyMadeExecutor):
    """Runs all callbacks on the thread that spins."""

    _dispatch = Executor._run


class MultiThreadedExecutor(_ReadyMadeExecutor):
    """Runs callbacks on a pool of threads, as far as their callback groups let them run in parallel."""

    _ENDS = (*_ReadyMadeExecutor._ENDS, ExternalShutdownException)  # unlike on one thread, as in rclpy

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
            lambda: pool_threads.add(threading.get_ident()),  # the threads shall not keep the executor alive
        )
        self._errors: deque[BaseException] = deque()
        self._in_pool = 0  # callbacks under way there
        self._wakes = WaitSet()  # for nothing but being woken
        self._wakes.attach(self._guard.handle, _WAKE)
        self._dds.append(self._wakes)

    def _next(self, deadline: int | None, condition: Callable[[], bool] | None) -> tuple[Any, Any]:
        """Wait for a free thread, then for work: what is taken earlier grows old, and more and more of it."""
        while self._in_pool >= self._threads:
            self._check(condition)
            timeout = _remaining(deadline)
            if not timeout:
                raise TimeoutException
            if self._wakes.wait(timeout):
                self._guard.take()
        return super()._next(deadline, condition)

    def _spin(
        self, deadline: int | None, condition: Callable[[], bool] | None, *, once: bool = False
    ) -> None:
        super()._spin(
            deadline, lambda: bool(self._errors) or (condition is not None and condition()), once=once
        )
        if self._errors:
            raise self._errors.popleft()

    def _dispatch(self, entity: Any, taken: Any) -> None:
        with self._idle:
            self._in_pool += 1
        try:
            self._pool.submit(self._run_in_pool, entity, taken)
        except RuntimeError:  # shut down meanwhile, by a signal's handler on this thread
            self._run_in_pool(entity, taken)

    def _run_in_pool(self, entity: Any, taken: Any) -> None:
        try:
            self._run(entity, taken)
        except BaseException as error:
            self._errors.append(error)
        finally:
            with self._idle:
                self._in_pool -= 1
                self._idle.notify_all()
                # The spinning thread may be waiting for a thread, this entity's callback group, or an error.
                # Under the lock: whoever waits in shutdown() ends afterwards what this wakes by.
                self.wake()

    def _is_idle(self) -> bool:
        return super()._is_idle() and not self._in_pool

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop, and wait for callbacks that run, unless one of them asks: see :meth:`Executor.shutdown`."""
        if threading.get_ident() in self._pool_threads:
            timeout_sec = 0  # a callback cannot wait for itself to end
        return super().shutdown(timeout_sec)

    def _close(self) -> None:
        super()._close()
        self._pool.shutdown(wait=False)
