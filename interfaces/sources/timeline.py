"""Timelines: values over the time of a scenario [s since its origin]."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Events(Generic[T]):
    """Values, each with its time; as a state, a value holds until the next one."""

    items: tuple[tuple[float, T], ...]
    repeat: float | None = None
    """The period [s] with which all items come again."""

    @property
    def fastest(self) -> float:
        """How fast the value changes at most [1/s]."""
        return math.inf if self.repeat is not None or len(self.items) > 1 else 0.0

    def at(self, time: float) -> T | None:
        """Return the value that holds at a time; None before the first one."""
        held = list(itertools.takewhile(lambda item: item[0] <= time, self._around(time)))
        return held[-1][1] if held else None

    def since(self, time: float) -> Iterator[tuple[float, T]]:
        """Yield the item that holds at a time, if there is one, then the items after that time."""
        until = list(itertools.takewhile(lambda item: item[0] <= time, self._around(time)))
        return itertools.chain(until[-1:], self.after(time))

    def after(self, time: float) -> Iterator[tuple[float, T]]:
        return itertools.dropwhile(lambda item: item[0] <= time, self._around(time))

    def _around(self, time: float) -> Iterator[tuple[float, T]]:
        """Yield all items, or those from a whole round before a time."""
        if self.repeat is None:
            return iter(self.items)
        rounds = itertools.count(max(0, math.floor(time / self.repeat) - 1))
        return ((at + round_ * self.repeat, item) for round_ in rounds for at, item in self.items)


@dataclass(frozen=True)
class Sweep:
    """A smooth movement between two ends, sampled at a rate.

    Without a rest it is center + amplitude · sin(2π · t/period + phase).
    """

    center: float
    amplitude: float
    period: float
    """From one low end to the next [s], including the rests."""
    rate: float = 25.0
    """Samples per second [Hz]."""
    phase: float = 0.0
    """The part of the period [rad] by which the sweep is ahead."""
    rest: float = 0.0
    """How long it stays at each end [s]; less than half the period."""

    @property
    def fastest(self) -> float:
        """How fast the value changes at most [1/s]."""
        return self.amplitude * math.pi / (self.period / 2 - self.rest)

    def at(self, time: float) -> float:
        ends, since_end = self._since_end(time)
        moved = min(since_end / (self.period / 2 - self.rest), 1.0)
        return self.center - self.amplitude * math.cos(math.pi * (ends + moved))

    def rest_left(self, time: float) -> float:
        """Return the time [s] from ``time`` until the end of a rest; 0 while it moves."""
        left = self.period / 2 - self._since_end(time)[1]
        return left if left <= self.rest else 0.0

    def _since_end(self, time: float) -> tuple[float, float]:
        """Return the number of movements before a time since a low end, and the time since the last began."""
        half = self.period / 2
        return divmod(time + self.period * self.phase / math.tau + (half - self.rest) / 2, half)
