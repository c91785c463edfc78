"""Dangers to the arm on this machine: disk, clock, loopback interface, load, a flood."""

from __future__ import annotations

import math
import shutil
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from interfaces.loopback import LOOPBACK_DOWN, loopback_is_up
from interfaces.seam import replaceable

LOW_DISK, ENOUGH_DISK = 200e6, 300e6  # free bytes: a warning begins below the first and ends at the second
FLOOD = "flood"
CLOCK_STEP = 0.05  # s; clocks may differ by as much (A3 in SAFETY.md)
STEP_SHOWN = 60.0  # s for which a step of the clock is a warning
LATE = 0.05  # s; half of the delay that the safety case allows (A4 in SAFETY.md)
MANY, LOST = 10_000, 100  # UDP datagrams a second that are a flood: those that arrive, and those lost
FLOOD_WINDOW = 5.0  # s; while an arm starts on ROS 2's wheels, 13,000 a second arrive for two seconds
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
    datagrams: int = 0
    """of UDP that have arrived since the kernel started"""
    lost: int = 0
    """those of them for which a socket had no room"""


def figures(run: Path) -> Figures:
    """Ask the kernel."""
    free = disk_free(run)
    clocks = time.monotonic(), time.time(), time.monotonic()
    return Figures(free, loopback_is_up(), *clocks, *datagrams())


@replaceable
def disk_free(run: Path) -> float:
    """Return the free bytes of the disk of a run directory; infinite if it is gone."""
    with suppress(OSError):
        return shutil.disk_usage(run).free
    return math.inf


@replaceable
def datagrams() -> tuple[int, int]:
    """Return how many UDP datagrams have arrived, and how many of them were lost."""
    with suppress(OSError, KeyError), open("/proc/net/snmp", encoding="ascii") as file:
        names, values = (line.split()[1:] for line in file if line.startswith("Udp:"))
        counts = dict(zip(names, map(int, values), strict=True))
        lost = counts["InErrors"]
        return counts["InDatagrams"] + counts["NoPorts"] + lost, lost
    return 0, 0


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
        self._counts: deque[tuple[float, int, int]] = deque()  # time, datagrams that arrived, and lost ones

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
                " a full disk loses logs and records"
            )
        if now.before - self._stepped < STEP_SHOWN:
            way = "forward" if self._step > 0 else "back"
            found["clock"] = (
                f"the time of day was set {way} by {abs(self._step):.2f} s:"
                " heartbeats and presences may count as old; NTP or PTP keeps it steady"
            )
        if not now.loopback_is_up:
            found["loopback"] = LOOPBACK_DOWN
        if self._is_flooded(now):
            found[FLOOD] = (
                f"more than {MANY} UDP datagrams arrive each second, or more than {LOST} find no room:"
                " discovery and messages are late"
            )
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

    def _is_flooded(self, now: Figures) -> bool:
        self._counts.append((now.before, now.datagrams, now.lost))
        while len(self._counts) > 1 and self._counts[1][0] <= now.before - FLOOD_WINDOW:
            self._counts.popleft()
        _, datagrams, lost = self._counts[0]
        return now.datagrams - datagrams > MANY * FLOOD_WINDOW or now.lost - lost > LOST * FLOOD_WINDOW

    def _note_delay(self, delay: float, now: float) -> None:
        if delay > LATE:
            self._late.append(now)
        while self._late and now - self._late[0] >= LATE_WINDOW:
            self._late.popleft()
        self._is_overloaded = len(self._late) >= (1 if self._is_overloaded else LATE_LOOKS)
