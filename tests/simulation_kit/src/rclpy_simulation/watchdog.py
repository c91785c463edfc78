"""Notices that nothing has happened for a time: missed deadlines and lost liveliness."""

from __future__ import annotations

from collections.abc import Callable

from rclpy_simulation.process import Process


class Watchdog:
    """Rings when nothing has renewed it for a period.

    DDS runs it in a process: while that is stopped, it does not ring, and afterwards for all that time.
    """

    __slots__ = ("_is_running", "_is_stopped", "_period", "_process", "_ring", "_since")

    def __init__(self, process: Process, period: int, ring: Callable[[int], bool]) -> None:
        """Begin with a period [ns]; ``ring`` gets the number of periods, and returns whether to go on."""
        self._process = process
        self._period = period
        self._ring = ring
        self._since = 0
        self._is_running = False
        self._is_stopped = False

    def renew(self) -> None:
        """Begin a new period; start to watch if it does not run yet."""
        kernel = self._process.kernel
        self._since = kernel.now
        if not self._is_running:
            self._is_running = True
            kernel.after(self._period, self._check)

    def stop(self) -> None:
        self._is_stopped = True

    def _check(self) -> None:
        process = self._process
        if self._is_stopped or process.ended:
            return
        kernel = process.kernel
        periods = (kernel.now - self._since) // self._period
        if process.is_stopped:
            process.postpone(self._check)
            return
        if periods > 0:
            self._since += periods * self._period
            self._is_running = self._ring(periods)
        if self._is_running:
            kernel.schedule(self._since + self._period, self._check)
