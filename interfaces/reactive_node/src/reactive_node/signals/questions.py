"""The times for which a signal is asked: those of events, all multiples of a period, changes in between."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from reactivex import Observable

from reactive_node.signals.answers import CERTAIN, Answer, Refused
from reactive_node.signals.run import Node, Run
from reactive_node.signals.source import Source
from reactive_node.stamps import Timestamp, stamped


class Grid:
    """Asks at all multiples of a period, from now on."""

    def __init__(self, run: Run, node: Node, period: int, answer: Callable[[Answer[Any]], None]) -> None:
        """The period is in ns; ``answer`` receives the answers."""
        self._node, self._period, self._answer = node, period, answer
        self.restart(run.now())

    def answer(self, horizon: int) -> None:
        while self._next <= horizon:
            time, self._next = self._next, self._next + self._period
            value, mark = self._node.at(time)
            self._answer(Answer(time, value, mark))

    def next(self) -> int:
        return self._next

    def is_done(self, are_complete: bool) -> bool:
        """Return whether no sample will come any more."""
        return are_complete

    def restart(self, now: int) -> None:
        self._next = -(-now // self._period) * self._period


class Events(Source):
    """Asks at the times of events, which wait for their turn like samples."""

    def __init__(
        self,
        run: Run,
        node: Node,
        events: Observable[Timestamp[Any]],
        answer: Callable[[Any, Answer[Any]], None],
        *,
        lateness: int,
        refused: Callable[[Refused], None] | None,
    ) -> None:
        """``answer`` receives each event with its answer; for the others see :class:`Source`."""
        super().__init__(events, now=run.now, advance=run.advance, lateness=lateness, refused=refused)
        self._node, self._answer = node, answer
        self._asked: deque[tuple[int, Any]] = deque()
        self.needs(0, 0)
        run.add(self)

    def take(self, time: int, value: Any) -> None:
        """Keep an event until its answer is known."""
        self._asked.append((time, value))

    def answer(self, horizon: int) -> None:
        while self._asked and self._asked[0][0] <= horizon:
            time, event = self._asked.popleft()
            value, mark = self._node.at(time)
            self._answer(event, Answer(time, value, mark))

    def next(self) -> int | None:
        if self._asked:
            return self._asked[0][0]
        return self.waiting[0][0] if self.waiting else None

    def is_done(self, are_complete: bool) -> bool:
        """Return whether all events have come and are answered."""
        return self.is_complete and not self._asked

    def restart(self, now: int) -> None:
        super().restart(now)
        self._asked.clear()


class Crossings:
    """Finds the times at which a predicate changes, between those at which answers come in their order."""

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
