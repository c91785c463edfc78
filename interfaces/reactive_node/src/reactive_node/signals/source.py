"""Samples on their way into a signal: they wait until none can come before them."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any

from reactivex import Observable

from reactive_node.signals.answers import Refused
from reactive_node.stamps import UNSTAMPED, Timestamp

SECOND = 1_000_000_000  # ns
_FAR = 1 << 62  # ns, more than any time


def nanoseconds(what: str, seconds: float) -> int:
    """Return a duration in ns. Raises ValueError if it is not more than 0 s."""
    duration = round(seconds * SECOND)
    if duration <= 0:
        raise ValueError(f"{what} must be more than 0 s, not {seconds} s")
    return duration


class Memory:
    """Keeps values for the answers to come."""

    low, high = _FAR, -_FAR
    """The first and the last time whose value an answer needs, relative to the time of the answer [ns]."""

    def needs(self, low: int, high: int) -> None:
        """Note what an answer needs."""
        self.low, self.high = min(self.low, low), max(self.high, high)

    def forget(self, time: int) -> None:
        """Drop what only times before this one need [ns]."""

    def restart(self, now: int) -> None:
        """Begin at another time [ns]: the clock was set."""


class Source(Memory):
    """Takes samples in the order of their times, however they arrive."""

    def __init__(
        self,
        samples: Observable[Timestamp[Any]],
        *,
        now: Callable[[], int],
        advance: Callable[[], None],
        lateness: int,
        refused: Callable[[Refused], None] | None,
    ) -> None:
        """Wait for samples.

        :param now: returns the time by the clock of the stamps [ns].
        :param advance: called when something may have become known.
        :param lateness: a sample that is older when it arrives [ns], or that much ahead of the clock, is
            refused.
        """
        self.samples = samples
        self.is_complete = False
        self.lateness = lateness
        self.settled = now() - self.lateness
        """No sample up to this time will be taken any more [ns]."""
        self.wait = self.lateness
        """How long it takes at most until a value is known [ns]."""
        self.waiting: list[tuple[int, int, Any]] = []
        self.newest: Timestamp[Any] | None = None
        """The sample with the latest time, late or not, of those that were not ahead of the clock."""
        self._arrivals = 0
        self._now, self._advance, self._refused = now, advance, refused

    def receive(self, sample: Timestamp[Any]) -> None:
        """Let a sample wait for its turn, or refuse it."""
        value, time = sample
        now = self._now()
        self.settle(now)
        self._arrivals += 1
        if time == UNSTAMPED:
            self.refuse(Refused(time, value, "it has no stamp"))
        elif time > now + self.lateness:
            self.refuse(Refused(time, value, f"it is {(time - now) / SECOND:.3f} s ahead of the clock"))
        else:
            is_newest = self.newest is None or time > self.newest.nanoseconds
            if is_newest:
                self.newest = sample
            if time > self.settled:
                heapq.heappush(self.waiting, (time, self._arrivals, value))
            else:
                reason = f"it is {(now - time) / SECOND:.3f} s late"
                late = Refused(time, value, reason, is_first=self._arrivals == 1)
                (self.take_late if is_newest else self.refuse)(late)
        self._advance()

    def complete(self) -> None:
        """Expect no further sample."""
        self.is_complete = True
        self._advance()

    def settle(self, now: int) -> int:
        """Take the samples before which none can come; return the time up to which values are known [ns]."""
        settled = _FAR if self.is_complete else now - self.lateness
        if settled > self.settled:
            self.settled = settled
            while self.waiting and self.waiting[0][0] <= settled:
                time, _, value = heapq.heappop(self.waiting)
                self.take(time, value)
        return self.settled

    def refuse(self, sample: Refused) -> None:
        """Report a sample."""
        if self._refused is not None:
            self._refused(sample)

    def restart(self, now: int) -> None:
        """Begin at another time [ns]: the clock was set."""
        self.settled = now - self.lateness
        if self.newest is not None:
            self.newest = self.newest._replace(nanoseconds=min(self.newest.nanoseconds, self.settled))
        self.waiting.clear()

    def take(self, time: int, value: Any) -> None:
        """Take the next sample in the order of time."""
        raise NotImplementedError

    def take_late(self, late: Refused) -> None:
        """Report the newest sample of all, which is too late; its value may count from another time on."""
        self.refuse(late)
