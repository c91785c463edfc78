"""Values over time: what a virtual source does, and when."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class Timeline(Protocol[T_co]):
    """Values over time [s since the scenario's origin]."""

    catches_up: bool
    """Whether values whose time has passed unnoticed (a stopped process) are still worth something."""

    def at(self, time: float) -> T_co | None:
        """Return the value that holds at a time, ``None`` if there is none yet."""

    def after(self, time: float) -> Iterator[tuple[float, T_co]]:
        """Return the changes after a time, in order, each with its time."""


@dataclass(frozen=True)
class Events(Generic[T]):
    """Single values, each from its time on."""

    items: tuple[tuple[float, T], ...]
    repeat: float | None = None
    """All of them again and again, with this period [s]."""
    catches_up = True

    def at(self, time: float) -> T | None:
        """Return the last value up to a time."""
        value = None
        for _, item in itertools.takewhile(lambda item: item[0] <= time, self._around(time)):
            value = item
        return value

    def after(self, time: float) -> Iterator[tuple[float, T]]:
        """Return the values after a time."""
        return itertools.dropwhile(lambda item: item[0] <= time, self._around(time))

    def _around(self, time: float) -> Iterator[tuple[float, T]]:
        """Return the values since the beginning, or since a whole round before a time."""
        if self.repeat is None:
            return iter(self.items)
        rounds = itertools.count(max(0, math.floor(time / self.repeat) - 1))
        return ((at + round_ * self.repeat, item) for round_ in rounds for at, item in self.items)


@dataclass(frozen=True)
class Sweep:
    """center + amplitude · sin(2π · t/period + phase) at t = ``delay`` + n / ``rate``, n = …, -1, 0, 1, …"""

    center: float
    amplitude: float
    period: float
    rate: float = 25.0
    phase: float = 0.0
    delay: float = 0.0
    catches_up = False

    def at(self, time: float) -> float:
        """Return the value at a time."""
        return self.center + self.amplitude * math.sin(math.tau * time / self.period + self.phase)

    def after(self, time: float) -> Iterator[tuple[float, float]]:
        """Return the values after a time."""
        steps = itertools.count(math.floor((time - self.delay) * self.rate) + 1)
        times = (self.delay + step / self.rate for step in steps)
        return ((at, self.at(at)) for at in times)
