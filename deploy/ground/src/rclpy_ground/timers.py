"""Timers."""

from __future__ import annotations

from rclpy_ground.clocks import Clock
from rclpy_ground.contexts import Context
from rclpy_ground.genuine import RCLError, genuine
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import INFINITY

_TimerCanceled = getattr(genuine, "TimerCancelledError", RCLError)  # since Kilted


class Timer(Destroyable):
    """A timer of a clock: the times of its calls are multiples of its period, however late one was."""

    def __init__(self, clock: Clock, context: Context, period: int, autostart: bool = True) -> None:
        if period < 0:
            raise RCLError("failed to create timer: timer period must be non-negative")
        if not context.is_valid:
            raise RCLError("failed to create timer: the context is invalid")
        super().__init__()
        self.clock = clock
        self._context = context
        self._period = int(period)
        self._last = clock.nanoseconds()
        self._expected = self._next = self._last + self._period
        self._is_canceled = not autostart
        clock.add_timer(self)

    def remaining(self, steady: int) -> int:
        """Return the time to wait [ns]: endless if it is canceled, or if only a message can make it due.

        :param steady: the present time of the steady clock [ns].
        """
        if self._is_canceled:
            return INFINITY
        clock = self.clock
        if clock.is_steady:
            return self._next - steady
        left = self._next - clock.nanoseconds()
        return left if clock.override is None or left <= 0 else INFINITY

    def note_jump(self, is_change: bool, delta: int) -> None:
        """Note that ROS time was set: with a change of its source, or backwards."""
        now = self.clock.nanoseconds()
        if is_change:
            if self.clock.was_set:
                self._next += delta
                self._last += delta
        elif now < self._last:
            self._last, self._next = now, now + self._period

    def reset_timer(self) -> None:
        self._next = self.clock.nanoseconds() + self._period
        self._is_canceled = False
        self._context.guard.trigger()

    def is_timer_ready(self) -> bool:
        return not self._is_canceled and self.clock.nanoseconds() >= self._next

    def call_timer(self) -> None:
        if self._is_canceled:
            raise _TimerCanceled("failed to call timer: it is canceled")
        self._call(self.clock.nanoseconds())

    def call_if_ready(self) -> bool:
        """Note a call of the timer if it is due; return whether it was. It reads the clock once."""
        if self._is_canceled or (now := self.clock.nanoseconds()) < self._next:
            return False
        self._call(now)
        return True

    def _call(self, now: int) -> None:
        self._expected, self._last = self._next, now
        period = self._period
        self._next += period
        if self._next <= now:  # late by more than a period: the next multiple that is to come
            self._next = now + period - (now - self._next) % period if period else now

    def call_timer_with_info(self) -> dict[str, int]:
        self.call_timer()
        return {"expected_call_time": self._expected, "actual_call_time": self._last}

    def change_timer_period(self, period: int) -> None:
        self._period = int(period)

    def time_until_next_call(self) -> int | None:
        return None if self._is_canceled else self._next - self.clock.nanoseconds()

    def time_since_last_call(self) -> int:
        return self.clock.nanoseconds() - self._last

    def get_timer_period(self) -> int:
        return self._period

    def cancel_timer(self) -> None:
        self._is_canceled = True

    def is_timer_canceled(self) -> bool:
        return self._is_canceled

    def destroy(self) -> None:
        self._is_canceled = True
