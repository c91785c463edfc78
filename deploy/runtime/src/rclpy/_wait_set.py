"""Wait sets for the waitables of users. Only executors of nodes with such waitables import this module."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from rclpy._dds import INFINITY, Reader
from rclpy._handle import ignore_change
from rclpy.exceptions import InvalidHandle
from rclpy.guard_condition import GuardCondition, GuardConditionHandle
from rclpy.timer import Timer, TimerHandle

if TYPE_CHECKING:
    from rclpy.callback_groups import CallbackGroup
    from rclpy.executors import Executor
    from rclpy.waitable import Waitable

_KINDS = ("subscription", "client", "service", "timer", "guard_condition", "event")


class WaitSet:
    """What the waitables of an executor wait for, with the methods of rclpy's wait set that they use."""

    def __init__(self) -> None:
        self._entities: dict[str, list[Any]] = {kind: [] for kind in _KINDS}
        self._is_ready: Callable[[str, Any], bool] = lambda kind, entity: False

    def add_subscription(self, subscription: Reader) -> int:
        """Add the ``handle`` of a subscription; return its index."""
        return self._add("subscription", subscription.condition)

    def add_service(self, service: Reader) -> int:
        """Add the ``handle`` of a service; return its index."""
        return self._add("service", service.condition)

    def add_timer(self, timer: TimerHandle) -> int:
        """Add the ``handle`` of a timer; return its index."""
        return self._add("timer", timer._rclpy_entity)

    def add_guard_condition(self, gc: GuardConditionHandle) -> int:
        """Add the ``handle`` of a guard condition; return its index."""
        return self._add("guard_condition", gc._rclpy_entity)

    def _add(self, kind: str, entity: Any) -> int:
        self._entities[kind].append(entity)
        return len(self._entities[kind]) - 1

    def is_ready(self, entity_type: str, index: int) -> bool:
        """Return whether an entity is ready after the wait.

        :param entity_type: such as ``"guard_condition"``.
        :param index: what the ``add_`` method has returned.
        :raises RuntimeError: if there is no such type.
        :raises IndexError: if there is no such index.
        """
        if entity_type not in self._entities:
            raise RuntimeError(f"'{entity_type}' is not a known entity")
        if not 0 <= index < len(self._entities[entity_type]):
            raise IndexError("wait set index too big")
        return self._is_ready(entity_type, self._entities[entity_type][index])


class WaitableEntity:
    """A waitable of a user, with the interface that executors use for every entity."""

    def __init__(self, waitable: Waitable, executor: Executor) -> None:
        self.waitable = waitable
        self._executor = weakref.ref(executor)

    @property
    def callback_group(self) -> CallbackGroup | None:
        return self.waitable.callback_group

    def _rclpy_take(self) -> tuple[Any]:
        return (self.waitable.take_data(),)

    def _rclpy_execute(self, taken: tuple[Any]) -> Any:
        executor = self._executor()
        for future in list(getattr(self.waitable, "_futures", ())):
            future._set_executor(executor)
        return self.waitable.execute(taken[0])


class _Wake:
    """Wakes an executor without keeping it alive."""

    def __init__(self, executor: Executor) -> None:
        self._executor = weakref.ref(executor)

    def __call__(self) -> None:
        if (executor := self._executor()) is not None:
            executor._rclpy_wake_if_waiting()


class WaitableWatch:
    """Lets an executor wait for the waitables of users."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._wake = _Wake(executor)
        self._wait_set = WaitSet()
        self._added: list[WaitableEntity] = []  # to the current wait set
        self._postponed: list[WaitableEntity] = []  # ready, but their callback group was busy
        self._triggers: weakref.WeakKeyDictionary[GuardCondition, int] = weakref.WeakKeyDictionary()
        self._tokens: dict[int, int] = {}  # DDS handle -> token in the executor's DDS wait set
        self.entities: list[WaitableEntity] = []

    def update(self, waitables: Iterable[Waitable]) -> None:
        known = {id(entity.waitable): entity for entity in self.entities}
        self.entities = [
            known.get(id(waitable)) or WaitableEntity(waitable, self._executor) for waitable in waitables
        ]
        self._postponed = [entity for entity in self._postponed if entity in self.entities]

    def postpone(self, entity: WaitableEntity) -> None:
        """Offer a ready waitable again when its callback group allows it."""
        self._postponed.append(entity)

    def prepare(self) -> int:
        """Let the waitables add what they wait for; return the time until a timer is due [ns]."""
        wait_set, self._added = WaitSet(), []
        for entity in self.entities:
            if entity not in self._postponed and self._executor.can_execute(entity):
                try:
                    with entity.waitable:
                        entity.waitable.add_to_wait_set(wait_set)
                except InvalidHandle:
                    continue
                self._added.append(entity)
        self._wait_set = wait_set
        self._attach(
            {
                handle: None  # in order, unlike a set
                for kind in ("subscription", "client", "service", "event")
                for handle in wait_set._entities[kind]
            }
        )
        if any(self._executor.can_execute(entity) for entity in self._postponed):
            return 0
        if any(map(self._is_triggered, self._watched("guard_condition"))):
            return 0
        remaining = min((timer._rclpy_remaining() for timer in self._watched("timer")), default=INFINITY)
        return max(0, remaining)  # DDS refuses the negative time of an overdue timer

    def _watched(self, kind: str) -> list[Any]:
        """The timers or guard conditions in the wait set, whose changes will wake the executor."""
        for entity in self._wait_set._entities[kind]:
            if entity._rclpy_on_change is ignore_change or isinstance(entity._rclpy_on_change, _Wake):
                entity._rclpy_on_change = self._wake
        return self._wait_set._entities[kind]

    def _attach(self, handles: dict[int, None]) -> None:
        for handle in [each for each in self._tokens if each not in handles]:
            del self._tokens[handle]
            self._executor._rclpy_waitset.detach(handle)
        for handle in handles:
            if handle in self._tokens or handle in self._executor._rclpy_tokens:
                continue
            self._executor._rclpy_last_token += 1
            if self._executor._rclpy_waitset.attach(handle, self._executor._rclpy_last_token):
                self._tokens[handle] = self._executor._rclpy_last_token

    def _is_triggered(self, guard: GuardCondition) -> bool:
        return guard._rclpy_last_trigger != self._triggers.get(guard, 0) and not guard._rclpy_destroyed

    def ready(self, tokens: list[int]) -> list[WaitableEntity]:
        """Return the waitables that are ready after a wait, which has returned the tokens."""
        guards = {
            guard: guard._rclpy_last_trigger
            for guard in self._wait_set._entities["guard_condition"]
            if self._is_triggered(guard)
        }
        self._triggers.update(guards)

        def is_ready(kind: str, entity: Any) -> bool:
            if kind == "timer":
                timer: Timer = entity
                return not timer._rclpy_destroyed and timer.is_ready()
            if kind == "guard_condition":
                return entity in guards
            return (self._tokens.get(entity) or self._executor._rclpy_tokens.get(entity)) in tokens

        self._wait_set._is_ready = is_ready
        ready = [entity for entity in self._postponed if self._executor.can_execute(entity)]
        self._postponed = [entity for entity in self._postponed if entity not in ready]
        return ready + [entity for entity in self._added if entity.waitable.is_ready(self._wait_set)]
