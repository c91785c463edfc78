"""The integral of a signal."""

from __future__ import annotations

from collections import deque
from typing import Any

from reactive_node.signals import values
from reactive_node.signals.answers import UNKNOWN
from reactive_node.signals.run import Node, Run
from reactive_node.signals.source import SECOND, Memory


class Integral(Memory):
    """Sums trapezoids between the multiples of a step, and keeps the sums that answers may need."""

    def __init__(self, run: Run, node: Node, step: int) -> None:
        """The step is in ns."""
        self._node, self._step = node, step
        self.restart(run.now())
        run.add(self)

    def needs(self, low: int, high: int) -> None:
        """Note what an answer needs: sums, and the signal from the last step on."""
        super().needs(low, high)
        self._node.needs(low - self._step, high)

    def restart(self, now: int) -> None:
        """Begin again."""
        self._next = -(-now // self._step)  # the step of the next sum
        self._last: tuple[Any, int] = None, UNKNOWN  # the value at the step before
        self._sums: deque[tuple[Any, int]] = deque()

    def forget(self, time: int) -> None:
        """Sum up to a time before the signal forgets its values, and drop the sums before."""
        self._sum(time // self._step)
        while len(self._sums) > max(1, self._next - time // self._step):
            self._sums.popleft()

    def at(self, time: int) -> tuple[Any, int]:
        """Return the integral up to a time."""
        step = time // self._step
        self._sum(step)
        index = step - self._next + len(self._sums)
        if index < 0 or not self._sums:
            return None, UNKNOWN
        return self._add(self._sums[index], self._node.at(step * self._step), time, time - step * self._step)

    def _sum(self, step: int) -> None:
        while self._next <= step:
            time = self._next * self._step
            if self._sums:
                self._sums.append(self._add(self._sums[-1], self._last, time, self._step))
            self._last = value, mark = self._node.at(time)
            if not self._sums and mark != UNKNOWN:
                self._sums.append((values.slope(value, value, 1.0), mark))  # zero
            self._next += 1

    def _add(
        self, sum_: tuple[Any, int], before: tuple[Any, int], time: int, elapsed: int
    ) -> tuple[Any, int]:
        after = self._node.at(time)
        mark = max(sum_[1], before[1], after[1])
        if mark == UNKNOWN:
            return None, UNKNOWN
        return values.trapezoid(sum_[0], before[0], after[0], elapsed / SECOND), mark
