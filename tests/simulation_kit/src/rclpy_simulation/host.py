"""Hosts: each has a time of day of its own."""

from __future__ import annotations

SECOND = 10**9  # [ns]
BOOT = 1000 * SECOND  # monotonic clock at the beginning of a simulation [ns]
MIDNIGHT = 1_767_225_600 * SECOND  # time of day at that moment: 2026-01-01, 0:00 UTC [ns since 1970]


class Host:
    """A machine with a time of day of its own; monotonic time is the same on all hosts."""

    def __init__(self, name: str, epoch: int = MIDNIGHT) -> None:
        """:param epoch: the time of day at the beginning of the simulation [ns since 1970]."""
        self.name = name
        self._offset = epoch - BOOT
        self._drift = 0.0
        self._since = BOOT

    def time_of_day(self, now: int) -> int:
        """Return the time of day at a moment of the monotonic clock [ns since 1970]."""
        return now + self._offset + (int((now - self._since) * self._drift) if self._drift else 0)

    def step(self, seconds: float) -> None:
        """Set the time of day forward, or back if negative."""
        self._offset += int(seconds * SECOND)

    def drift(self, rate: float, now: int) -> None:
        """Let the time of day run faster from now on: by ``rate`` [s/s], slower if negative."""
        self._offset += int((now - self._since) * self._drift)
        self._since, self._drift = now, rate
