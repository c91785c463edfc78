"""What on this machine is about to harm the arm: its disk, its clock, its loopback interface, its load."""

from __future__ import annotations

import math
import shutil
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from interfaces.loopback import LOOPBACK_DOWN, loopback_is_up

LOW_DISK, ENOUGH_DISK = 200e6, 300e6  # free bytes: a warning begins below the first and ends at the second
CLOCK_STEP = 0.05  # s; clocks may differ by as much (A3 in SAFETY.md)
STEP_SHOWN = 60.0  # s for which a step of the clock is a warning
LATE = 0.05  # s; half of the delay that the safety case allows (A4 in SAFETY.md)
LATE_LOOKS, LATE_WINDOW = 3, 10.0  # so many late looks within so many seconds are an overload; none ends it


class Figures(NamedTuple):
    """The figures of the kernel at one time."""

    disk_free: float
    """of the disk of the run directory [bytes]"""
    loopback_is_up: bool
    before: float
    """the monotonic clock just before the time of day was read [s]"""
    time_of_day: float
    """[s since 1970]"""
    after: float
    """the monotonic clock just after that [s]"""


def figures(run: Path) -> Figures:
    """Ask the kernel; a run directory that is gone has a disk without end."""
    disk_free = math.inf
    with suppress(OSError):
        disk_free = shutil.disk_usage(run).free
    return Figures(disk_free, loopback_is_up(), time.monotonic(), time.time(), time.monotonic())


class Machine:
    """Judges the figures of one look after the other."""

    def __init__(self, run: Path, period: float) -> None:
        """:param period: of the looks [s]."""
        self._run = run
        self._period = period
        self._last: Figures | None = None
        self._disk_is_low = False
        self._step, self._stepped = 0.0, -math.inf
        self._late: deque[float] = deque()  # when looks were late
        self._is_overloaded = False

    def skip(self) -> None:
        """Judge no delay of the next look: this one waits for something else than the processor."""
        self._last = None

    def warnings(self, now: Figures) -> dict[str, str]:
        """Return what is about to harm the arm, by what it concerns."""
        self._disk_is_low = now.disk_free < (ENOUGH_DISK if self._disk_is_low else LOW_DISK)
        if self._last is not None:
            self._note_step(self._last, now)
            self._note_delay(now.before - self._last.before - self._period, now.before)
        self._last = now
        found = {}
        if self._disk_is_low:
            found["disk"] = (
                f"less than {LOW_DISK / 1e6:.0f} MB are free for {self._run}:"
                " a full disk loses logs, records and settings"
            )
        if now.before - self._stepped < STEP_SHOWN:
            way = "forward" if self._step > 0 else "back"
            found["clock"] = (
                f"the time of day was set {way} by {abs(self._step):.2f} s:"
                " heartbeats and presences may count as old; NTP or PTP keeps it steady"
            )
        if not now.loopback_is_up:
            found["loopback"] = LOOPBACK_DOWN
        if self._is_overloaded:
            found["overload"] = (
                f"timers come more than {1000 * LATE:.0f} ms late: the processor has too much to do"
            )
        return found

    def _note_step(self, last: Figures, now: Figures) -> None:
        """Note a step of the time of day, unless a pause between the two readings may explain it."""
        forward = (now.time_of_day - now.after) - (last.time_of_day - last.before)
        back = (last.time_of_day - last.after) - (now.time_of_day - now.before)
        if max(forward, back) > CLOCK_STEP:
            self._step, self._stepped = (forward if forward > back else -back), now.before

    def _note_delay(self, delay: float, now: float) -> None:
        if delay > LATE:
            self._late.append(now)
        while self._late and now - self._late[0] >= LATE_WINDOW:
            self._late.popleft()
        self._is_overloaded = len(self._late) >= (1 if self._is_overloaded else LATE_LOOKS)
