"""The times at which a predicate of a signal changes, found between the times at which it is looked at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reactive_node.signals.answers import CERTAIN, Answer
from reactive_node.signals.run import Node
from reactive_node.stamps import Timestamp, stamped


class Crossings:
    """Looks at answers in the order of time, and emits the changes of a predicate."""

    def __init__(
        self,
        node: Node,
        predicate: Callable[[Any], bool],
        period: int,
        emit: Callable[[Timestamp[bool]], None],
    ) -> None:
        """The answers are a period [ns] apart; the predicate was false before."""
        self._node, self._predicate, self._period, self._emit = node, predicate, period, emit
        self._was_true = False

    def look(self, answer: Answer[Any]) -> None:
        """Compare an answer with the one before."""
        if answer.mark == CERTAIN:
            is_true = bool(self._predicate(answer.value))
            if is_true != self._was_true:
                time = self._change(answer.time)
                self._was_true = is_true
                self._emit(stamped(is_true, time))

    def _change(self, after: int) -> int:
        """Return the time of the change before a time, by bisection: to the nanosecond [ns]."""
        before = after - self._period
        while after - before > 1:
            middle = (before + after) // 2
            value, mark = self._node.at(middle)
            if mark == CERTAIN and bool(self._predicate(value)) != self._was_true:
                after = middle
            else:
                before = middle
        return after
