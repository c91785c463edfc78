"""The part of an executor that waits: for which nodes and entities, and for how long."""

from __future__ import annotations

import threading
import time
import weakref
from collections import deque
from typing import TYPE_CHECKING, Any, Protocol, cast

from rclpy import _dds
from rclpy._dds import INFINITY
from rclpy.callback_groups import CallbackGroup
from rclpy.task import Task

if TYPE_CHECKING:
    from rclpy._wait_set import WaitableWatch
    from rclpy.executors import Executor
    from rclpy.node import Node
    from rclpy.timer import Timer
    from rclpy.waitable import Waitable

# In a flood, ready readers take further messages in turn for this long [ns]. Then timers are checked again.
# So a flood of messages needs few waits, and a slow callback delays the others only by its own duration.
_BURST = 200_000
# A wait that begins this soon [ns] after the last one or its burst belongs to a flood. After a longer break,
# a second look at a reader would find nothing.
_BREAK = 50_000
WAKE = 0
"""The wait set's token of the guard condition."""


class Entity(Protocol):
    """An entity with a callback: subscription, timer, service, client, guard condition or events."""

    @property
    def callback_group(self) -> CallbackGroup | None: ...

    def _rclpy_take(self) -> Any: ...

    def _rclpy_execute(self, taken: Any) -> Any: ...


class ExecutorEntities:
    """What an executor waits for: the readers, timers and guard conditions of its nodes."""

    def __init__(self) -> None:
        super().__init__()
        self._nodes: list[Node] = []
        self._nodes_lock = threading.RLock()
        self._tasks: deque[Task] = deque()
        self._is_shutdown = False

        self._guard = _dds.GuardCondition()
        self._rclpy_waitset = _dds.WaitSet()
        self._rclpy_waitset.attach(self._guard.handle, WAKE)
        # Closed with the executor, even if that is garbage-collected without a shutdown.
        self._rclpy_dds: list[_dds.WaitSet | _dds.GuardCondition] = [self._rclpy_waitset, self._guard]
        self._rclpy_close_dds = weakref.finalize(self, _close, self._rclpy_dds)
        self._rclpy_close_dds.atexit = False  # at exit, DDS closes everything itself
        self._rclpy_callback_thread: int | None = None  # the spinning thread, while it runs a callback
        # Only the spinning thread uses the rest, except these three flags.
        self._rclpy_changed = True  # anything but data and time: one of the others, or a reason to end
        self._rclpy_entities_changed = True
        self._rclpy_groups_changed = False
        self._rclpy_only_nodes: list[Node] | None = None  # if given, wait for these instead of the added ones
        # Nodes in the wait set, with the version of their entities.
        self._rclpy_seen: list[tuple[Node, int]] = []
        self._rclpy_timers: list[Timer] = []
        self._rclpy_guards: list[Any] = []
        self._rclpy_watch: WaitableWatch | None = None  # if nodes have waitables of users
        self._rclpy_attached: dict[int, tuple[Entity, int]] = {}  # token -> entity, DDS handle
        self._rclpy_blocked: dict[int, tuple[Entity, int]] = {}  # the same, while the callback group is busy
        self._rclpy_reserved: set[Any] = set()  # entities of tasks that have not begun
        self._rclpy_tokens: dict[int, int] = {}  # DDS handle -> token
        self._rclpy_last_token = WAKE
        # Entities or tasks. A reader may have several messages: with its DDS handle, the others with 0.
        self._rclpy_ready: deque[tuple[Any, int]] = deque()
        self._rclpy_repeatable: deque[tuple[Any, int]] = deque()  # readers that had a message in this burst
        self._rclpy_burst_end = 0
        self._rclpy_flood_end = 0
        self._rclpy_tasks_were_first = False

    def get_nodes(self) -> list[Node]:
        with self._nodes_lock:
            return list(self._nodes)

    def _rclpy_entities_have_changed(self) -> None:
        self._rclpy_entities_changed = True
        self._rclpy_wake_if_waiting()

    def _rclpy_wait_only_for(self, nodes: list[Node] | None) -> None:
        self._rclpy_only_nodes = nodes
        self._rclpy_entities_changed = True

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

    def can_execute(self, entity: Any) -> bool:
        """Return whether the callback group of ``entity`` allows it to run now."""
        if entity in self._rclpy_reserved:
            return False
        return entity.callback_group is None or bool(entity.callback_group.can_execute(entity))

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
        next_timer, timeout = self._rclpy_collect_timers(now, timeout)
        watch = self._rclpy_watch
        if watch is not None and (remaining := watch.prepare()) < timeout:
            next_timer, timeout = None, remaining
        tokens = self._rclpy_waitset.wait(timeout)
        if tokens:
            self._rclpy_collect_readers(tokens, now)
        elif next_timer is not None:
            self._rclpy_ready.append((next_timer, 0))  # the wait lasted until the timer was due
        if watch is not None:
            self._rclpy_ready.extend((entity, 0) for entity in watch.ready(tokens))
        if self._tasks:
            self._rclpy_collect_tasks()

    def _rclpy_collect_tasks(self) -> None:
        while self._tasks:
            self._rclpy_ready.append((self._tasks.popleft(), 0))

    def _rclpy_collect_timers(self, now: int, timeout: int) -> tuple[Timer | None, int]:
        """Collect the timers that are due; return the one that ends the wait, and the rest of its time."""
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
        return next_timer, timeout

    def _rclpy_collect_readers(self, tokens: list[int], now: int) -> None:
        """Collect the readers that a wait has found; note whether it belongs to a flood."""
        self._rclpy_burst_end = now + _BURST if now < self._rclpy_flood_end else 0
        self._rclpy_flood_end = (self._rclpy_burst_end or now) + _BREAK
        if len(tokens) > 1:
            tokens.sort()  # subscriptions before services and clients, as in rclpy
        for token in tokens:
            if token == WAKE:
                self._guard.take()
            elif (attached := self._rclpy_attached.get(token)) is not None:
                self._rclpy_ready.append(attached)

    # The contents of the wait set

    def _rclpy_update_entities(self) -> None:
        self._rclpy_entities_changed = False  # first: later changes are handled in the next round
        nodes = self.get_nodes() if self._rclpy_only_nodes is None else self._rclpy_only_nodes
        seen = [(node, node._rclpy_entities_version) for node in nodes]
        if seen == self._rclpy_seen:
            return  # rclpy.spin_once() adds and removes its node with every call
        self._rclpy_seen = seen
        self._rclpy_timers, self._rclpy_guards = [], []
        wanted: dict[int, Entity] = {}
        waitables: list[Waitable] = []
        for node in nodes:
            self._rclpy_timers.extend(node.timers)
            self._rclpy_guards.extend(node.guards)
            waitables.extend(node._rclpy_added_waitables)
            for entity in node._rclpy_waitables():
                self._rclpy_timers.extend(getattr(entity, "_rclpy_timers", ()))
                wanted |= dict.fromkeys(entity._rclpy_handles, entity)
        self._rclpy_update_handles(wanted)
        self._rclpy_update_waitables(waitables)
        self._rclpy_repeatable.clear()
        if self._rclpy_ready:
            self._rclpy_drop_others({*self._rclpy_timers, *self._rclpy_guards, *wanted.values()})

    def _rclpy_update_handles(self, wanted: dict[int, Entity]) -> None:
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

    def _rclpy_update_waitables(self, waitables: list[Waitable]) -> None:
        if self._rclpy_watch is None and waitables:
            from rclpy._wait_set import WaitableWatch  # here: few programs have waitables

            self._rclpy_watch = WaitableWatch(cast("Executor", self))
        if self._rclpy_watch is not None:
            self._rclpy_watch.update(waitables)

    def _rclpy_drop_others(self, present: set[Any]) -> None:
        if self._rclpy_watch is not None:
            present.update(self._rclpy_watch.entities)
        left = [one for one in self._rclpy_ready if one[0].__class__ is Task or one[0] in present]
        self._rclpy_ready.clear()
        self._rclpy_ready.extend(left)

    def _rclpy_block(self, entity: Entity) -> None:
        """Stop waiting for an entity whose callback group is busy: its data would end every wait at once."""
        if self._rclpy_watch is not None and entity in self._rclpy_watch.entities:
            self._rclpy_watch.postpone(entity)
        self._rclpy_detach(entity)
        # Never set to False here: another thread may just have freed the group and set it.
        if self.can_execute(entity):
            self._rclpy_groups_changed = self._rclpy_changed = True

    def _rclpy_detach(self, entity: Entity) -> None:
        for token, (attached, handle) in list(self._rclpy_attached.items()):
            if attached is entity:
                del self._rclpy_attached[token]
                self._rclpy_waitset.detach(handle)
                self._rclpy_blocked[token] = (entity, handle)

    def _rclpy_unblock(self) -> None:
        self._rclpy_groups_changed = False
        for token, (entity, handle) in list(self._rclpy_blocked.items()):
            if self.can_execute(entity):
                del self._rclpy_blocked[token]
                if self._rclpy_waitset.attach(handle, token):
                    self._rclpy_attached[token] = (entity, handle)

    def _rclpy_end_execution(self, entity: Entity) -> None:
        if entity.callback_group is not None:
            entity.callback_group.ending_execution(entity)
            if self._rclpy_blocked:
                self._rclpy_groups_changed = self._rclpy_changed = True


def _close(entities: list[_dds.WaitSet | _dds.GuardCondition]) -> None:
    for entity in entities:
        entity.close()
