"""Clocks, and the events that wait for a time of a clock."""

from __future__ import annotations

import threading
import time
import weakref
from typing import Any, Protocol

from rclpy_ground import choice
from rclpy_ground.genuine import RCLError, genuine
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import GuardCondition, Handle

_ROS_TIME, _STEADY_TIME = int(genuine.ClockType.ROS_TIME), int(genuine.ClockType.STEADY_TIME)
_ACTIVATED = genuine.ClockChange.ROS_TIME_ACTIVATED
_DEACTIVATED = genuine.ClockChange.ROS_TIME_DEACTIVATED
_NO_CHANGE = genuine.ClockChange.ROS_TIME_NO_CHANGE


class _Timer(Protocol):
    def note_jump(self, is_change: bool, delta: int) -> None: ...


class Clock(Destroyable):
    def __init__(self, clock_type: int) -> None:
        super().__init__()
        self.type = int(clock_type)
        self.is_steady = self.type == _STEADY_TIME
        self.override: int | None = None
        """The time [ns] while ROS time is set by messages."""
        self.condition: Handle = None
        """Is true after ROS time was set, from the first time on that messages set it, until it is noted."""
        self._guard: GuardCondition | None = None
        self._latest = 0
        self._jumps: dict[Any, tuple[bool, int, int]] = {}
        self._timers: weakref.WeakSet[Any] = weakref.WeakSet()

    @property
    def was_set(self) -> bool:
        """Whether ROS time has been set to another time than 0."""
        return self._latest != 0

    def nanoseconds(self) -> int:
        """Return its time [ns]."""
        if self.override is not None:
            return self.override
        return time.monotonic_ns() if self.is_steady else time.time_ns()

    def add_timer(self, timer: _Timer) -> None:
        """Let a timer note jumps of ROS time."""
        if self.type == _ROS_TIME:
            self._timers.add(timer)

    def get_now(self) -> Any:
        return genuine.rcl_time_point_t(self.nanoseconds(), self.type)

    def get_ros_time_override_is_enabled(self) -> bool:
        if self.type != _ROS_TIME:
            raise RCLError("failed to get ROS time override status: not a ROS clock")
        return self.override is not None

    def set_ros_time_override_is_enabled(self, enabled: bool) -> None:
        if self.type != _ROS_TIME:
            raise RCLError("failed to set ROS time override: not a ROS clock")
        if enabled != (self.override is not None):
            if enabled and self._guard is None:
                self._guard = choice.ground.create_guard_condition()
                self.condition = self._guard.handle
            self._jump(_ACTIVATED if enabled else _DEACTIVATED, self._latest if enabled else None)

    def set_ros_time_override(self, time_point: Any) -> None:
        if self.type != _ROS_TIME:
            raise RCLError("failed to set ROS time override: not a ROS clock")
        self._latest = time_point.nanoseconds
        if self.override is not None:
            self._jump(_NO_CHANGE, self._latest)

    def _jump(self, change: Any, override: int | None) -> None:
        """Set ROS time, or with ``None`` follow the system's again; call those who want to know."""
        before = self.nanoseconds()
        delta = (time.time_ns() if override is None else override) - before
        is_change = change != _NO_CHANGE
        concerned = [handle for handle, wish in self._jumps.items() if _is_concerned(wish, is_change, delta)]
        for handle in concerned:
            if handle._pre_callback is not None:
                handle._pre_callback()
        self.override = override
        for timer in sorted(self._timers, key=lambda each: each.pointer):
            timer.note_jump(is_change, delta)
        for handle in concerned:
            if handle._post_callback is not None:
                handle._post_callback({"clock_change": change, "delta": delta})
        if self._guard is not None:
            self._guard.trigger()

    def note_taken(self) -> None:
        """Note that a wait set has seen the time that was set."""
        if self._guard is not None:
            self._guard.take()

    def add_clock_callback(self, handle: Any, on_change: bool, forward: int, backward: int) -> None:
        if handle in self._jumps:
            raise RCLError("failed to add time jump callback: it was added before")
        self._jumps[handle] = on_change, forward, backward

    def remove_clock_callback(self, handle: Any) -> None:
        if self._jumps.pop(handle, None) is None:
            raise RCLError("failed to remove time jump callback: it was not found")


def _is_concerned(wish: tuple[bool, int, int], is_change: bool, delta: int) -> bool:
    on_change, forward, backward = wish  # thresholds [ns]; 0 is none
    if is_change:
        return on_change
    return bool(forward and delta >= forward) or bool(backward and delta <= backward)


class ClockEvent:
    """An event for which a thread waits until a time of a clock."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.is_set, self.set, self.clear = self._event.is_set, self._event.set, self._event.clear

    def wait_until_steady(self, clock: Clock, until: Any) -> None:
        self._event.wait(max(0.0, (until.nanoseconds - clock.nanoseconds()) / 1e9))

    wait_until_system = wait_until_steady

    def wait_until_ros(self, clock: Clock, until: Any) -> None:
        if clock.override is None:
            self.wait_until_steady(clock, until)
        elif clock.override < until.nanoseconds:
            self._event.wait()
