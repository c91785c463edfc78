"""Timers, and rates."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy._dds import INFINITY
from rclpy._handle import EntityHandle, ignore_change
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockChange, JumpThreshold, TimeJump
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle, RCLError, ROSInterruptException
from rclpy.utilities import get_default_context

if TYPE_CHECKING:
    from rclpy.context import Context

TimerCallbackType = Callable[[], Any]


class TimerHandle(EntityHandle["Timer"]):
    """A timer for a waitable that waits for it."""

    def is_timer_ready(self) -> bool:
        return self._rclpy_entity.is_ready()

    def call_timer(self) -> None:
        """Start the next period, as a call of the timer's callback does."""
        self._rclpy_entity._rclpy_take()


class Timer:
    """Calls back in each period of its clock. The periods do not drift; missed periods are skipped."""

    def __init__(
        self,
        callback: TimerCallbackType,
        callback_group: CallbackGroup,
        timer_period_ns: int,
        clock: Clock,
        *,
        context: Context | None = None,
        autostart: bool = True,
    ) -> None:
        """Create a timer with a period [ns]; usually, :meth:`rclpy.node.Node.create_timer` does."""
        if timer_period_ns < 0:
            raise RCLError("failed to create timer: timer period must be non-negative")
        self.callback = callback
        self.callback_group = callback_group
        self._context = get_default_context() if context is None else context
        self._clock = clock
        self._rclpy_source = clock.handle
        self._rclpy_is_steady = clock.clock_type == ClockType.STEADY_TIME
        self._rclpy_period = int(timer_period_ns)
        self._rclpy_last_call = self._rclpy_source.nanoseconds()
        self._rclpy_next_call = self._rclpy_last_call + self._rclpy_period
        self._rclpy_canceled = not autostart
        self._rclpy_destroyed = False
        # Called when the time until the next call changes.
        self._rclpy_on_change: Callable[[], None] = ignore_change
        self._rclpy_jump_handle = None
        if clock.clock_type == ClockType.ROS_TIME:
            self._rclpy_jump_handle = clock.create_jump_callback(
                JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1)),
                post_callback=self._rclpy_time_has_jumped,
            )

    def _rclpy_time_has_jumped(self, jump: TimeJump) -> None:
        now = self._rclpy_source.nanoseconds()
        if jump.clock_change in (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED):
            # The source of time changes: keep the rest of the period. Except before the first simulated time,
            # which will be a jump back and start a new period.
            if self._rclpy_source._latest:
                self._rclpy_next_call += jump.delta.nanoseconds
                self._rclpy_last_call += jump.delta.nanoseconds
        elif now < self._rclpy_last_call:
            self._rclpy_last_call = now
            self._rclpy_next_call = now + self._rclpy_period
        self._rclpy_on_change()

    @property
    def handle(self) -> TimerHandle:
        """A handle for the timer. Raises InvalidHandle if it was destroyed."""
        return TimerHandle(self._rclpy_usable())

    def _rclpy_usable(self) -> Timer:
        if self._rclpy_destroyed:
            raise InvalidHandle("cannot use a timer that was destroyed")
        return self

    @property
    def clock(self) -> Clock:
        return self._clock

    @property
    def timer_period_ns(self) -> int:
        """The period [ns]. A change takes effect with the next call."""
        return self._rclpy_usable()._rclpy_period

    @timer_period_ns.setter
    def timer_period_ns(self, value: int) -> None:
        self._rclpy_usable()._rclpy_period = int(value)

    def is_ready(self) -> bool:
        return (
            not self._rclpy_usable()._rclpy_canceled
            and self._rclpy_source.nanoseconds() >= self._rclpy_next_call
        )

    def is_canceled(self) -> bool:
        return self._rclpy_usable()._rclpy_canceled

    def cancel(self) -> None:
        """Stop until :meth:`reset`."""
        self._rclpy_usable()._rclpy_canceled = True

    def reset(self) -> None:
        """Start a new period now."""
        self._rclpy_usable()._rclpy_next_call = self._rclpy_source.nanoseconds() + self._rclpy_period
        self._rclpy_canceled = False
        self._rclpy_on_change()

    def time_since_last_call(self) -> int:
        """Return the time since the last call, or since the creation [ns]."""
        return self._rclpy_source.nanoseconds() - self._rclpy_usable()._rclpy_last_call

    def time_until_next_call(self) -> int | None:
        """Return the time until the next call [ns], negative if overdue, ``None`` if canceled."""
        return (
            None
            if self._rclpy_usable()._rclpy_canceled
            else self._rclpy_next_call - self._rclpy_source.nanoseconds()
        )

    def destroy(self) -> None:
        """Destroy it. :meth:`rclpy.node.Node.destroy_timer` also removes it from the node."""
        self._rclpy_destroyed = self._rclpy_canceled = True
        if self._rclpy_jump_handle is not None:
            self._rclpy_jump_handle.unregister()

    # The interface that executors use for every entity.

    def _rclpy_remaining(self) -> int:
        """Return the time to wait [ns]: infinite if canceled, or not yet due in simulated time."""
        if self._rclpy_canceled:
            return INFINITY
        override = self._rclpy_source._override
        if override is None:
            return self._rclpy_next_call - self._rclpy_source._read()
        # Simulated time advances by messages, which wake the executor.
        return INFINITY if self._rclpy_next_call > override else 0

    def _rclpy_take(self) -> tuple[()] | None:
        if self._rclpy_canceled:
            return None
        override = self._rclpy_source._override
        now = self._rclpy_source._read() if override is None else override
        if now < self._rclpy_next_call:
            return None
        self._rclpy_last_call = now
        self._rclpy_next_call += self._rclpy_period
        if self._rclpy_next_call <= now:
            behind = now - self._rclpy_next_call
            self._rclpy_next_call = (
                now if not self._rclpy_period else now + self._rclpy_period - behind % self._rclpy_period
            )
        return ()

    def _rclpy_execute(self, taken: tuple[()]) -> Any:
        return self.callback()


class Rate:
    """Sleeps at a rate, on a thread that does not spin the node."""

    def __init__(self, timer: Timer, *, context: Context) -> None:
        """Create a rate from a timer; usually, :meth:`rclpy.node.Node.create_rate` does."""
        self._timer = timer
        self._rclpy_clock = timer.clock
        self._rclpy_context = context
        self._rclpy_ticks = threading.Condition()
        self._rclpy_tick = 0
        self._rclpy_overrun = False  # whether the latest tick has not ended a sleep
        self._is_destroyed = False
        timer.callback = self._rclpy_wake
        context.on_shutdown(self._rclpy_end)

    def _rclpy_wake(self) -> None:
        with self._rclpy_ticks:
            self._rclpy_tick += 1
            self._rclpy_overrun = True
            self._rclpy_ticks.notify_all()

    def _rclpy_end(self) -> None:
        with self._rclpy_ticks:
            self._is_destroyed = True
            self._rclpy_ticks.notify_all()

    def destroy(self) -> None:
        """Destroy the rate and wake its sleepers."""
        self._rclpy_end()

    def sleep(self) -> None:
        """Sleep until the next tick, or not at all if a tick came since the last sleep.

        :raises ROSInterruptException: if the context is shut down before or during the sleep.
        :raises RuntimeError: if the rate was destroyed before; its destruction during the sleep just ends it.
        """
        with self._rclpy_ticks:
            if self._is_destroyed and self._rclpy_context.ok():
                raise RuntimeError("Rate cannot sleep because it has been destroyed")
            if not self._rclpy_overrun:
                tick = self._rclpy_tick
                self._rclpy_ticks.wait_for(lambda: self._rclpy_tick != tick or self._is_destroyed)
            self._rclpy_overrun = False
            if not self._rclpy_context.ok():
                raise ROSInterruptException
