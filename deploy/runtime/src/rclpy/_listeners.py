"""Who is told of something."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, TypeVar
from weakref import WeakValueDictionary

Listener = TypeVar("Listener")


class Listeners(Generic[Listener]):
    """
    A set of objects that are told of something as long as others keep them alive.

    It may change while it is iterated, on other threads or in a signal's handler, where a ``WeakSet`` fails
    and a lock may be held already: who is there is noted in one step, when the iteration begins.
    """

    def __init__(self) -> None:
        self._listeners: WeakValueDictionary[int, Listener] = WeakValueDictionary()

    def add(self, listener: Listener) -> None:
        """Tell this one, too."""
        self._listeners[id(listener)] = listener

    def discard(self, listener: Listener) -> None:
        """Tell this one no longer, if it was told."""
        self._listeners.pop(id(listener), None)

    def __iter__(self) -> Iterator[Listener]:
        for reference in self._listeners.valuerefs():
            if (listener := reference()) is not None:
                yield listener
