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
from functools import partial
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


class _Entity(Protocol):
    """An entity with a callback: subscription, timer, service, client, guard condition or events."""

    @property
    def callback_group(self) -> CallbackGroup | None: ...

    def _rclpy_take(self) -> Any: ...

    def _rclpy_execute(self, taken: Any) -> Any: ...


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
        if not self._context._rclpy_valid:
            raise NotInitializedException
        self._nodes: list[Node] = []
        self._nodes_lock = threading.RLock()
        self._tasks: deque[Task] = deque()
        self._is_shutdown = False
        self._rclpy_is_global = (
            False  # the default of rclpy.spin(), which returns silently after rclpy.shutdown()
        )
        self._rclpy_closed = False
        self._rclpy_idle = threading.Condition()

        self._guard = _dds.GuardCondition()
        self._rclpy_waitset = _dds.WaitSet()
        self._rclpy_waitset.attach(self._guard.handle, _WAKE)
        # Closed with the executor, also if it is garbage-collected without a shutdown.
        self._rclpy_dds: list[_dds.WaitSet | _dds.GuardCondition] = [self._rclpy_waitset, self._guard]
        self._rclpy_close_dds = weakref.finalize(self, _close, self._rclpy_dds)
        self._rclpy_close_dds.atexit = False  # at exit, DDS closes everything itself
        self._rclpy_spinning_thread: int | None = None
        self._rclpy_callback_thread: int | None = None  # the spinning thread, while it runs a callback
        # Only the spinning thread uses the rest, except these three flags.
        self._rclpy_changed = True  # anything but data and time: one of the others, or a reason to end
        self._rclpy_entities_changed = True
        self._rclpy_groups_changed = False
        self._rclpy_only_nodes: list[Node] | None = None  # if given, wait for these instead of the added ones
        self._rclpy_seen: list[
            tuple[Node, int]
        ] = []  # nodes in the wait set, with the version of their entities
        self._rclpy_timers: list[Timer] = []
        self._rclpy_guards: list[Any] = []
        self._rclpy_watch: WaitableWatch | None = None  # if nodes have waitables of users
        self._rclpy_attached: dict[int, tuple[_Entity, int]] = {}  # token -> entity, DDS handle
        self._rclpy_blocked: dict[int, tuple[_Entity, int]] = {}  # likewise, while the callback group is busy
        self._rclpy_tokens: dict[int, int] = {}  # DDS handle -> token
        self._rclpy_last_token = _WAKE
        # Entities or tasks. A reader may have several messages: with its DDS handle, the others with 0.
        self._rclpy_ready: deque[tuple[Any, int]] = deque()
        self._rclpy_repeatable: deque[tuple[Any, int]] = deque()  # readers that had a message in this burst
        self._rclpy_burst_end = 0
        self._rclpy_flood_end = 0
        self._rclpy_tasks_were_first = False
        # For wait_for_ready_callbacks(): entities of tasks that have not begun; tasks that are not done, with
        # what else was returned; those of them to return before the next wait.
        self._rclpy_reserved: set[Any] = set()
        self._rclpy_offers: dict[Task, tuple[Any, Node | None]] = {}
        self._rclpy_offers_changed = False
        self._rclpy_round: deque[Task] | None = None
        self._context._rclpy_executors.add(self)
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
        self._rclpy_entities_have_changed()
        return True

    def remove_node(self, node: Node) -> None:
        """Remove a node: this executor stops running its callbacks."""
        with self._nodes_lock:
            if node not in self._nodes:
                return
            self._nodes.remove(node)
        self._rclpy_entities_have_changed()

    def get_nodes(self) -> list[Node]:
        """Return the nodes of this executor."""
        with self._nodes_lock:
            return list(self._nodes)

    def _rclpy_entities_have_changed(self) -> None:
        self._rclpy_entities_changed = True
        self._rclpy_wake_if_waiting()

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
        """Continue a task when the future that it awaits is over."""
        offered = task in self._rclpy_offers
        resume = self._rclpy_change_offers if offered else partial(self._rclpy_schedule, task)
        awaited = task._rclpy_awaited
        if awaited is None:
            resume()
        else:
            awaited._rclpy_call_when_complete(resume)

    # Spinning

    def wake(self) -> None:
        """Make the spinning thread check for work again; may be called from any thread."""
        self._rclpy_changed = True
        if not self._is_shutdown:
            self._guard.trigger()

    def _rclpy_wake_if_waiting(self) -> None:
        """Wake the spinning thread, unless it is running the caller and will check again anyway."""
        if threading.get_ident() == self._rclpy_callback_thread:
            self._rclpy_changed = True
        else:
            self.wake()

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        while self._context._rclpy_valid and not self._is_shutdown:
            self.spin_once()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Run one callback; wait for it at most ``timeout_sec`` (``None`` or negative: for ever).

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

    def _rclpy_next_offer(self, nodes: list[Node] | None) -> tuple[Task, Any, Node | None] | None:
        """
        Return a task that was returned before, but is not done, and can run now; ``None``: wait for others.

        Between two waits, each such task is returned once.
        """
        if self._rclpy_round is None:
            self._rclpy_offers_changed = False  # first: later changes are handled in the next round
            for task in [task for task in self._rclpy_offers if task._rclpy_is_over()]:
                del self._rclpy_offers[task]
            self._rclpy_round = deque(self._rclpy_offers)
        while self._rclpy_round:
            task = self._rclpy_round.popleft()
            entity, node = self._rclpy_offers[task]
            if task._rclpy_can_run() and (nodes is None or node is None or node in nodes):
                return task, entity, node
        self._rclpy_round = None
        return None

    def _rclpy_reserve(self, use: Callable[[Any], None], entity: Any) -> bool:
        """Use a ready task or entity, unless the entity must not run; return whether it was used."""
        if entity.__class__ is not Task:
            if not self.can_execute(entity):
                self._rclpy_block(entity)
                return False
            self._rclpy_reserved.add(entity)
            self._rclpy_detach(entity)
        use(entity)
        return True

    def _rclpy_offer(self, entity: Any, nodes: list[Node]) -> tuple[Task, Any, Node | None]:
        """Return the task of a reserved entity, which runs its callback, or a task of ``create_task()``."""
        task, node = entity, None
        if entity.__class__ is Task:
            entity = None
        else:
            task = Task(self._rclpy_run_reserved, (entity,), executor=self)
            entity = getattr(entity, "waitable", entity)
            node = next((node for node in nodes if entity in node._rclpy_entities()), None)
        self._rclpy_offers[task] = (entity, node)
        # When the task ends, its callback group may allow other callbacks, for which another thread may wait.
        task._rclpy_call_when_complete(self._rclpy_change_offers)
        return task, entity, node

    async def _rclpy_run_reserved(self, entity: Any) -> None:
        """Run the callback of an entity whose task a user's class has called."""
        group = entity.callback_group
        if group is not None and not group.beginning_execution(entity):
            self._rclpy_release(entity)
            return
        try:
            try:
                taken = entity._rclpy_take()
            finally:
                self._rclpy_release(entity)
            result = None if taken is None else entity._rclpy_execute(taken)
            if result.__class__ is CoroutineType:
                await result
        finally:
            self._rclpy_end_execution(entity)

    def _rclpy_release(self, entity: Any) -> None:
        """Wait for a reserved entity again."""
        self._rclpy_reserved.discard(entity)
        self._rclpy_groups_changed = True
        self.wake()

    def _rclpy_change_offers(self) -> None:
        self._rclpy_offers_changed = True
        self.wake()

    def _rclpy_wait_only_for(self, nodes: list[Node] | None) -> None:
        self._rclpy_only_nodes = nodes
        self._rclpy_entities_changed = True

    def can_execute(self, entity: Any) -> bool:
        """Return whether the callback group of ``entity`` allows it to run now."""
        if entity in self._rclpy_reserved:
            return False
        return entity.callback_group is None or bool(entity.callback_group.can_execute(entity))

    def _rclpy_work(
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

    def _rclpy_collect(self, deadline: int | None) -> None:
        """Wait for ready entities until the deadline has passed or :meth:`wake` is called; collect them."""
        now = time.monotonic_ns()
        timeout = INFINITY if deadline is None else deadline - now if deadline > now else 0
        if self._tasks:
            self._rclpy_tasks_were_first = not self._rclpy_tasks_were_first
            if self._rclpy_tasks_were_first:  # as in rclpy; the next time, they come after the data
                self._rclpy_collect_tasks()
                return
            timeout = 0
        for guard in self._rclpy_guards:
            if guard._rclpy_is_ready() and self.can_execute(guard):
                timeout = 0
                self._rclpy_ready.append((guard, 0))
        next_timer: Timer | None = None
        for timer in self._rclpy_timers:
            if timer._rclpy_canceled:  # most timers of schedulers are: saves the call
                continue
            remaining = timer._rclpy_next_call - now if timer._rclpy_is_steady else timer._rclpy_remaining()
            if remaining <= 0:
                if self.can_execute(timer):
                    next_timer, timeout = None, 0
                    self._rclpy_ready.append((timer, 0))
            elif remaining < timeout:
                next_timer, timeout = timer, remaining
        watch = self._rclpy_watch
        if watch is not None and (remaining := watch.prepare()) < timeout:
            next_timer, timeout = None, remaining
        tokens = self._rclpy_waitset.wait(timeout)
        if tokens:
            self._rclpy_burst_end = now + _BURST if now < self._rclpy_flood_end else 0
            self._rclpy_flood_end = (self._rclpy_burst_end or now) + _BREAK
            if len(tokens) > 1:
                tokens.sort()  # subscriptions before services and clients, as in rclpy
            for token in tokens:
                if token == _WAKE:
                    self._guard.take()
                elif (attached := self._rclpy_attached.get(token)) is not None:
                    self._rclpy_ready.append(attached)
        elif next_timer is not None:
            self._rclpy_ready.append((next_timer, 0))  # the wait lasted until the timer was due
        if watch is not None:
            self._rclpy_ready.extend((entity, 0) for entity in watch.ready(tokens))
        if self._tasks:
            self._rclpy_collect_tasks()

    def _rclpy_collect_tasks(self) -> None:
        while self._tasks:
            self._rclpy_ready.append((self._tasks.popleft(), 0))

    # The contents of the wait set

    def _rclpy_update_entities(self) -> None:
        """Update the wait set to the current entities of the nodes."""
        self._rclpy_entities_changed = False  # first: later changes are handled in the next round
        nodes = self.get_nodes() if self._rclpy_only_nodes is None else self._rclpy_only_nodes
        seen = [(node, node._rclpy_entities_version) for node in nodes]
        if seen == self._rclpy_seen:
            return  # rclpy.spin_once() adds and removes its node with every call
        self._rclpy_seen = seen
        self._rclpy_timers, self._rclpy_guards = [], []
        wanted: dict[int, _Entity] = {}
        waitables: list[Waitable] = []
        for node in nodes:
            self._rclpy_timers.extend(node.timers)
            self._rclpy_guards.extend(node.guards)
            waitables.extend(node._rclpy_added_waitables)
            for entity in node._rclpy_waitables():
                self._rclpy_timers.extend(getattr(entity, "_rclpy_timers", ()))
                for handle in entity._rclpy_handles:
                    wanted[handle] = entity
        for handle in [handle for handle in self._rclpy_tokens if handle not in wanted]:
            token = self._rclpy_tokens.pop(handle)
            if self._rclpy_attached.pop(token, None) is not None:
                self._rclpy_waitset.detach(handle)
            self._rclpy_blocked.pop(token, None)
        for handle, entity in wanted.items():
            if handle not in self._rclpy_tokens:
                self._rclpy_last_token += 1
                if self._rclpy_waitset.attach(handle, self._rclpy_last_token):
                    self._rclpy_tokens[handle] = self._rclpy_last_token
                    self._rclpy_attached[self._rclpy_last_token] = (entity, handle)
        self._rclpy_update_waitables(waitables)
        self._rclpy_repeatable.clear()
        if self._rclpy_ready:  # drop entities of nodes that were removed or destroyed
            present = {*self._rclpy_timers, *self._rclpy_guards, *wanted.values()}
            if self._rclpy_watch is not None:
                present.update(self._rclpy_watch.entities)
            left = [one for one in self._rclpy_ready if one[0].__class__ is Task or one[0] in present]
            self._rclpy_ready.clear()
            self._rclpy_ready.extend(left)

    def _rclpy_update_waitables(self, waitables: list[Waitable]) -> None:
        """Update what the waitables of users wait for."""
        if self._rclpy_watch is None and waitables:
            from rclpy._wait_set import WaitableWatch  # here: few programs have waitables

            self._rclpy_watch = WaitableWatch(self)
        if self._rclpy_watch is not None:
            self._rclpy_watch.update(waitables)

    def _rclpy_block(self, entity: _Entity) -> None:
        """Stop waiting for an entity whose callback group is busy: its data would end every wait at once."""
        if self._rclpy_watch is not None and entity in self._rclpy_watch.entities:
            self._rclpy_watch.postpone(entity)
        self._rclpy_detach(entity)
        # Never set to False here: another thread may just have freed the group and set it.
        if self.can_execute(entity):
            self._rclpy_groups_changed = self._rclpy_changed = True

    def _rclpy_detach(self, entity: _Entity) -> None:
        for token, (attached, handle) in list(self._rclpy_attached.items()):
            if attached is entity:
                del self._rclpy_attached[token]
                self._rclpy_waitset.detach(handle)
                self._rclpy_blocked[token] = (entity, handle)

    def _rclpy_unblock(self) -> None:
        """Wait again for entities whose callback group is free again."""
        self._rclpy_groups_changed = False
        for token, (entity, handle) in list(self._rclpy_blocked.items()):
            if self.can_execute(entity):
                del self._rclpy_blocked[token]
                if self._rclpy_waitset.attach(handle, token):
                    self._rclpy_attached[token] = (entity, handle)

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

    def _rclpy_end_execution(self, entity: _Entity) -> None:
        if entity.callback_group is not None:
            entity.callback_group.ending_execution(entity)
            if self._rclpy_blocked:
                self._rclpy_groups_changed = self._rclpy_changed = True

    def _rclpy_is_idle(self) -> bool:
        """Whether no thread spins or runs a callback."""
        return self._rclpy_spinning_thread is None

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """
        Stop, and wait until callbacks on other threads have ended.

        :return: whether they ended within ``timeout_sec`` (``None``: no limit).
        """
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


def _close(entities: list[_dds.WaitSet | _dds.GuardCondition]) -> None:
    for entity in entities:
        entity.close()


def _raise_exception_of(task: Task) -> None:
    if task.done() and task.exception() is not None:
        task.result()


class _BuiltInExecutor(Executor):
    """Base of this module's executors, with a minimum of code between waiting and callback."""

    _rclpy_spin_ends: tuple[type[Exception], ...] = (
        TimeoutException,
        ShutdownException,
        ConditionReachedException,
    )
    """These end the spinning without an error."""

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        if self._rclpy_overrides("spin_once", "wait_for_ready_callbacks"):
            super().spin()
            return
        while self._context._rclpy_valid and not self._is_shutdown:
            self._rclpy_spin(None, None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback; wait for it at most ``timeout_sec`` (``None`` or negative: for ever)."""
        self._rclpy_spin(_deadline(timeout_sec), None, once=True)

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        """Run one callback, unless ``future`` is done before one is ready."""
        future._rclpy_call_when_complete(self.wake)
        self._rclpy_spin(_deadline(timeout_sec), future._rclpy_is_over, once=True)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until ``future`` is done or cancelled, at most for ``timeout_sec``."""
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

    def _rclpy_take_back_offers(self) -> None:
        """Run what wait_for_ready_callbacks() has returned, and the user's class has not run to its end."""
        if self._rclpy_offers:
            offers, self._rclpy_offers, self._rclpy_round = self._rclpy_offers, {}, None
            self._tasks.extend(task for task in offers if not task._rclpy_is_over())

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

    _rclpy_spin_ends = (
        *_BuiltInExecutor._rclpy_spin_ends,
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
        self._rclpy_threads = num_threads or max(2, os.cpu_count() or 2)
        self._rclpy_pool_threads = pool_threads = set[int]()
        self._rclpy_pool = ThreadPoolExecutor(
            self._rclpy_threads,
            "rclpy-executor",
            lambda: pool_threads.add(
                threading.get_ident()
            ),  # without self: the threads must not keep the executor alive
        )
        self._rclpy_errors: deque[BaseException] = deque()
        self._rclpy_in_pool = 0  # running or queued callbacks
        self._rclpy_wake_set = _dds.WaitSet()  # contains the guard condition only
        self._rclpy_wake_set.attach(self._guard.handle, _WAKE)
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
