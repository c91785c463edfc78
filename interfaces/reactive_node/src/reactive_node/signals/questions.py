"""The times for which a signal is asked: those of events, or all multiples of a period."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from reactivex import Observable

from reactive_node.signals.answers import Answer, Refused
from reactive_node.signals.run import Node, Run
from reactive_node.signals.source import Source
from reactive_node.stamps import Timestamp


class Grid:
    """Asks at all multiples of a period, from now on."""

    def __init__(self, run: Run, node: Node, period: int, answer: Callable[[Answer[Any]], None]) -> None:
        """The period is in ns; ``answer`` receives the answers."""
        self._node, self._period, self._answer = node, period, answer
        self.restart(run.now())

    def answer(self, horizon: int) -> None:
        """Answer what is asked up to a time [ns]."""
        while self._next <= horizon:
            time, self._next = self._next, self._next + self._period
            value, mark = self._node.at(time)
            self._answer(Answer(time, value, mark))

    def next(self) -> int:
        """Return the earliest time without an answer [ns]."""
        return self._next

    def is_done(self, are_complete: bool) -> bool:
        """Return whether no sample will come any more."""
        return are_complete

    def restart(self, now: int) -> None:
        """Ask from now on [ns]."""
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
        """Answer what is asked up to a time [ns]."""
        while self._asked and self._asked[0][0] <= horizon:
            time, event = self._asked.popleft()
            value, mark = self._node.at(time)
            self._answer(event, Answer(time, value, mark))

    def next(self) -> int | None:
        """Return the earliest time without an answer [ns]; ``None`` if nothing is asked."""
        if self._asked:
            return self._asked[0][0]
        return self.waiting[0][0] if self.waiting else None

    def is_done(self, are_complete: bool) -> bool:
        """Return whether all events have come and are answered."""
        return self.is_complete and not self._asked

    def restart(self, now: int) -> None:
        """Ask from another time on [ns]: the clock was set."""
        super().restart(now)
        self._asked.clear()
