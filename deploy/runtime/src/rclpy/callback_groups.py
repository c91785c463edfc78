"""Callback groups: they decide which callbacks of a node may run at the same time."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any


class CallbackGroup:
    """Base of the callback groups, which decide when the callbacks of their entities may run."""

    def __init__(self) -> None:
        super().__init__()
        self.entities: set[weakref.ReferenceType[Any]] = set()

    def add_entity(self, entity: Any) -> None:
        """Add an entity; the group does not keep it alive."""
        self.entities.add(weakref.ref(entity, self.entities.discard))

    def has_entity(self, entity: Any) -> bool:
        return weakref.ref(entity) in self.entities

    def can_execute(self, entity: Any) -> bool:
        raise NotImplementedError

    def beginning_execution(self, entity: Any) -> bool:
        """Request permission to run `entity`; after `True`, `ending_execution` must follow."""
        raise NotImplementedError

    def ending_execution(self, entity: Any) -> None:
        """Return the permission after `entity` has run."""
        raise NotImplementedError


class ReentrantCallbackGroup(CallbackGroup):
    """Lets all callbacks run in parallel, even a callback with itself."""

    def can_execute(self, entity: Any) -> bool:
        return True

    def beginning_execution(self, entity: Any) -> bool:
        return True

    def ending_execution(self, entity: Any) -> None:
        """Do nothing."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Lets one callback run at a time."""

    def __init__(self) -> None:
        super().__init__()
        self._active_entity: Any = None
        # The single item is the permission to run. Popping it is atomic and much cheaper than a lock.
        self._rclpy_permission = [None]

    def can_execute(self, entity: Any) -> bool:
        return bool(self._rclpy_permission)

    def beginning_execution(self, entity: Any) -> bool:
        """Return `True`, and bar other callbacks, if no callback of the group is running."""
        try:
            self._rclpy_permission.pop()
        except IndexError:
            return False
        self._active_entity = entity
        return True

    def ending_execution(self, entity: Any) -> None:
        assert self._active_entity is entity, "ending_execution() of an entity that is not being executed"
        self._active_entity = None
        self._rclpy_permission.append(None)


_own_group: ContextVar[CallbackGroup | None] = ContextVar("_own_group", default=None)


@contextmanager
def _as_default(group: CallbackGroup) -> Iterator[None]:
    """Let the subscriptions that the block creates without a group belong to `group`.

    The methods of a user's node may know no parameter `callback_group`.
    """
    token = _own_group.set(group)
    try:
        yield
    finally:
        _own_group.reset(token)
