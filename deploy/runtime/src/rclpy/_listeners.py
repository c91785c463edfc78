"""A weak set of objects to notify, which may change while it is iterated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, TypeVar
from weakref import WeakValueDictionary

Listener = TypeVar("Listener")


class Listeners(Generic[Listener]):
    """A set of objects that does not keep them alive.

    Other threads and signal handlers may change it during an iteration: a ``WeakSet`` would fail, and a lock
    may already be held by the interrupted thread. An iteration copies the references first, in one step.
    """

    def __init__(self) -> None:
        self._listeners: WeakValueDictionary[int, Listener] = WeakValueDictionary()

    def add(self, listener: Listener) -> None:
        self._listeners[id(listener)] = listener

    def discard(self, listener: Listener) -> None:
        """Remove an object if it is in the set."""
        self._listeners.pop(id(listener), None)

    def __iter__(self) -> Iterator[Listener]:
        for reference in self._listeners.valuerefs():
            if (listener := reference()) is not None:
                yield listener
