"""Which callbacks of a node may run at the same time."""

from __future__ import annotations

import weakref
from typing import Any


class CallbackGroup:
    """
    Base of the callback groups: decides when the callbacks of its entities may run.

    An entity is a subscription, timer, service, client, guard condition or waitable.
    """

    def __init__(self) -> None:
        super().__init__()
        self.entities: set[weakref.ReferenceType[Any]] = set()

    def add_entity(self, entity: Any) -> None:
        """Make `entity` a member; the group does not keep it alive."""
        self.entities.add(weakref.ref(entity, self.entities.discard))

    def has_entity(self, entity: Any) -> bool:
        """Tell whether `entity` is a member."""
        return weakref.ref(entity) in self.entities

    def can_execute(self, entity: Any) -> bool:
        """Tell whether `entity` could run now."""
        raise NotImplementedError

    def beginning_execution(self, entity: Any) -> bool:
        """Ask to run `entity`; after `True`, `ending_execution` must be called when it has run."""
        raise NotImplementedError

    def ending_execution(self, entity: Any) -> None:
        """Say that `entity` has run."""
        raise NotImplementedError


class ReentrantCallbackGroup(CallbackGroup):
    """Lets all callbacks run in parallel, even a callback with itself."""

    def can_execute(self, entity: Any) -> bool:
        """Tell that `entity` may always run."""
        return True

    def beginning_execution(self, entity: Any) -> bool:
        """Permit to run `entity`."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Need no note of what has run."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Lets one callback run at a time."""

    def __init__(self) -> None:
        super().__init__()
        self._active_entity: Any = None
        # Its one item is the permission to run: to take it is one step, and a fraction of what a lock costs.
        self._permission = [None]

    def can_execute(self, entity: Any) -> bool:
        """Tell whether no callback of the group is running."""
        return bool(self._permission)

    def beginning_execution(self, entity: Any) -> bool:
        """Permit to run `entity` if no other callback of the group is running."""
        try:
            self._permission.pop()
        except IndexError:
            return False
        self._active_entity = entity
        return True

    def ending_execution(self, entity: Any) -> None:
        """Let the next callback run."""
        assert self._active_entity is entity, "ending_execution() of an entity that is not being executed"
        self._active_entity = None
        self._permission.append(None)
