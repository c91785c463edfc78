"""Faults that overlap: one lasts until the last one of its kind in its target has ended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable


class NestedFaults:
    def __init__(self) -> None:
        self._under_way: Counter[Hashable] = Counter()

    def begin(self, what: Hashable, undo: Callable[[], object]) -> Callable[[], None]:
        """Count a fault; return how to end it: ``undo`` runs when the last of this kind and target ends."""
        self._under_way[what] += 1

        def end() -> None:
            self._under_way[what] -= 1
            if not self._under_way[what]:
                undo()

        return end
