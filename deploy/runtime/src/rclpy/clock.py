"""Clocks: system time, steady time, and ROS time, which may be simulated.

Source: the ROS 2 design article "Clock and Time".
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from enum import IntEnum
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeAlias

from rclpy._handle import Handle
from rclpy.clock_type import ClockType
from rclpy.constants import S_TO_NS
from rclpy.duration import Duration
from rclpy.exceptions import NotInitializedException
from rclpy.time import Time, TimeHandle

if TYPE_CHECKING:
    from rclpy.context import Context

__all__ = [
    "Clock",
    "ClockChange",
    "ClockType",
    "JumpHandle",
    "JumpHandlePreCallbackType",
    "JumpThreshold",
    "ROSClock",
    "TimeJump",
    "TimeJumpDictionary",
]

JumpHandlePreCallbackType: TypeAlias = Callable[[], None]


class ClockChange(IntEnum):
    """Whether a time jump changes the source of ROS time."""

    ROS_TIME_NO_CHANGE = 1
    ROS_TIME_ACTIVATED = 2
    ROS_TIME_DEACTIVATED = 3
    SYSTEM_TIME_NO_CHANGE = 4


class TimeJumpDictionary(dict[str, int]):
    """A time jump as rclpy's C layer reports it: ``clock_change`` and ``delta`` [ns]."""


class JumpThreshold:
    """Selects the time jumps that a callback is called for."""

    def __init__(
        self,
        *,
        min_forward: Duration | None,
        min_backward: Duration | None,
        on_clock_change: bool = True,
    ) -> None:
        """Select jumps by size and cause.

        :param min_forward: the shortest jump forward to report, ``None``: none; positive.
        :param min_backward: the shortest jump backward to report, ``None``: none; negative.
        :param on_clock_change: whether to report a change of the source of time.
        :raises ValueError: if a threshold has the wrong sign, or no jump is selected.
        """
        if min_forward is not None and min_forward.nanoseconds <= 0:
            raise ValueError("min_forward must be a positive non-zero duration")
        if min_backward is not None and min_backward.nanoseconds >= 0:
            raise ValueError("min_backward must be a negative non-zero duration")
        if min_forward is None and min_backward is None and not on_clock_change:
            raise ValueError("At least one jump threshold must be enabled")
        self.min_forward = min_forward
        self.min_backward = min_backward
        self.on_clock_change = on_clock_change


class TimeJump:
    def __init__(self, clock_change: ClockChange, delta: Duration) -> None:
        self._clock_change = clock_change
        self._delta = delta

    @property
    def clock_change(self) -> ClockChange:
        return self._clock_change

    @property
    def delta(self) -> Duration:
        """New time minus old time."""
        return self._delta


class JumpHandle:
    """A registered pair of jump callbacks; ``unregister`` or the end of a ``with`` removes it."""

    def __init__(
        self,
        *,
        clock: Clock,
        threshold: JumpThreshold,
        pre_callback: JumpHandlePreCallbackType | None,
        post_callback: Callable[[TimeJumpDictionary], None] | None,
    ) -> None:
        if pre_callback is None and post_callback is None:
            raise ValueError("One of pre_callback or post_callback must be callable")
        if pre_callback is not None and not callable(pre_callback):
            raise ValueError("pre_callback must be callable if given")
        if post_callback is not None and not callable(post_callback):
            raise ValueError("post_callback must be callable if given")
        self._clock: Clock | None = clock
        self.threshold = threshold
        self.pre_callback = pre_callback
        self.post_callback = post_callback
        clock.handle.add_clock_callback(
            self,
            threshold.on_clock_change,
            0 if threshold.min_forward is None else threshold.min_forward.nanoseconds,
            0 if threshold.min_backward is None else threshold.min_backward.nanoseconds,
        )

    def unregister(self) -> None:
        if self._clock is not None:
            self._clock.handle.remove_clock_callback(self)
            self._clock = None

    def __enter__(self) -> JumpHandle:
        return self

    def __exit__(
        self, t: type[BaseException] | None, v: BaseException | None, tb: TracebackType | None
    ) -> None:
        self.unregister()


class ClockHandle(Protocol):
    """The source of a clock's time, and the callbacks for its jumps."""

    def get_now(self) -> TimeHandle: ...

    def get_ros_time_override_is_enabled(self) -> bool: ...

    def set_ros_time_override_is_enabled(self, enabled: bool) -> None: ...

    def set_ros_time_override(self, time_point: TimeHandle) -> None: ...

    def add_clock_callback(
        self, pyjump_handle: JumpHandle, on_clock_change: bool, min_forward: int, min_backward: int
    ) -> None: ...

    def remove_clock_callback(self, pyjump_handle: JumpHandle) -> None: ...


class _Listener(NamedTuple):
    """Jump callbacks with their thresholds forward and backward [ns], 0: none."""

    jump_handle: JumpHandle
    on_clock_change: bool
    min_forward: int
    min_backward: int

    def is_affected_by(self, change: ClockChange, delta: int) -> bool:
        if change in (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED):
            return self.on_clock_change
        return (0 < self.min_forward <= delta) or (0 > self.min_backward >= delta)


class _ClockSource(Handle):
    """The implementation of ClockHandle: reads the machine's clock, or returns the simulated time."""

    def __init__(self, clock_type: ClockType) -> None:
        self._type = clock_type
        self._read = time.monotonic_ns if clock_type == ClockType.STEADY_TIME else time.time_ns
        self._override: int | None = None  # simulated time [ns]; None: not simulated
        self._latest = 0
        self._listeners: list[_Listener] = []
        self._lock = threading.Lock()

    def nanoseconds(self) -> int:
        override = self._override
        return self._read() if override is None else override

    def get_now(self) -> Time:
        return Time._rclpy_of(self.nanoseconds(), self._type)

    def get_ros_time_override_is_enabled(self) -> bool:
        return self._override is not None

    def add_clock_callback(
        self, pyjump_handle: JumpHandle, on_clock_change: bool, min_forward: int, min_backward: int
    ) -> None:
        listener = _Listener(pyjump_handle, on_clock_change, min_forward, min_backward)
        with self._lock:
            self._listeners = [*self._listeners, listener]

    def remove_clock_callback(self, pyjump_handle: JumpHandle) -> None:
        with self._lock:
            self._listeners = [one for one in self._listeners if one.jump_handle is not pyjump_handle]

    def set_ros_time_override_is_enabled(self, enabled: bool) -> None:
        if enabled == (self._override is not None):
            return
        if enabled:
            self._change(self._latest, ClockChange.ROS_TIME_ACTIVATED)
        else:
            self._change(None, ClockChange.ROS_TIME_DEACTIVATED)

    def set_ros_time_override(self, time_point: TimeHandle) -> None:
        self._latest = nanoseconds = time_point.nanoseconds
        if self._override is not None and self._override != nanoseconds:
            self._change(nanoseconds, ClockChange.ROS_TIME_NO_CHANGE)

    def _change(self, override: int | None, change: ClockChange) -> None:
        delta = (self._read() if override is None else override) - self.nanoseconds()
        for handle in self._affected(change, delta):
            if handle.pre_callback is not None:
                handle.pre_callback()
        if change == ClockChange.ROS_TIME_NO_CHANGE and self._override is None:
            return  # another thread has ended the simulated time meanwhile
        self._override = override
        jump = TimeJumpDictionary(clock_change=change, delta=delta)
        # Query again: a callback added meanwhile may have read the old time.
        for handle in self._affected(change, delta):
            if handle.post_callback is not None:
                handle.post_callback(jump)

    def _affected(self, change: ClockChange, delta: int) -> list[JumpHandle]:
        return [one.jump_handle for one in self._listeners if one.is_affected_by(change, delta)]


class Clock:
    """A source of time: system time, unless ``clock_type`` chooses another."""

    _rclpy_source: _ClockSource
    _rclpy_clock_type: ClockType

    def __new__(cls, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> Clock:
        """Create a clock, a :class:`ROSClock` for ROS time. Raises TypeError for another type of argument."""
        if not isinstance(clock_type, ClockType):
            raise TypeError("Clock type must be a ClockType enum")
        self = super().__new__(ROSClock if clock_type == ClockType.ROS_TIME else cls)
        self._rclpy_source = _ClockSource(clock_type)
        self._rclpy_clock_type = clock_type
        return self

    @property
    def clock_type(self) -> ClockType:
        """The type of time of this clock."""
        return self._rclpy_clock_type

    @property
    def handle(self) -> _ClockSource:
        """The source behind this clock."""
        return self._rclpy_source

    def __repr__(self) -> str:
        return f"Clock(clock_type={self._rclpy_clock_type.name})"

    def now(self) -> Time:
        return self._rclpy_source.get_now()

    def create_jump_callback(
        self,
        threshold: JumpThreshold,
        *,
        pre_callback: JumpHandlePreCallbackType | None = None,
        post_callback: Callable[[TimeJump], None] | None = None,
    ) -> JumpHandle:
        """Call back before and after time jumps.

        The caller must keep the handle alive. ``post_callback`` gets the jump.

        :raises ValueError: if neither callback is given, or one is not callable.
        """
        if post_callback is not None and not callable(post_callback):
            raise ValueError("post_callback must be callable if given")

        def report(jump: TimeJumpDictionary) -> None:
            assert post_callback is not None
            delta = Duration(nanoseconds=jump["delta"])
            post_callback(TimeJump(ClockChange(jump["clock_change"]), delta))

        return JumpHandle(
            clock=self,
            threshold=threshold,
            pre_callback=pre_callback,
            post_callback=None if post_callback is None else report,
        )

    def sleep_until(self, until: Time, context: Context | None = None) -> bool:
        """Sleep until the time ``until`` of this clock.

        :return: whether the time was reached; ``False`` if the context was shut down or the source of ROS
            time changed.
        :raises ValueError: if ``until`` is of another clock type.
        :raises NotInitializedException: if the context is not initialized.
        """
        if context is None:
            from rclpy.utilities import get_default_context

            context = get_default_context()
        if not context.ok():
            raise NotInitializedException
        if until.clock_type != self._rclpy_clock_type:
            raise ValueError("until's clock type does not match this clock's type")
        event = threading.Event()
        source_changed = False

        def on_jump(jump: TimeJump) -> None:
            nonlocal source_changed
            changes = (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED)
            source_changed = source_changed or jump.clock_change in changes
            event.set()

        step = Duration(nanoseconds=1)
        threshold = JumpThreshold(min_forward=step, min_backward=Duration(nanoseconds=-1))
        context._rclpy_wake_on_shutdown(event)
        with self.create_jump_callback(threshold, post_callback=on_jump):
            while not source_changed and context.ok():
                remaining = until.nanoseconds - self._rclpy_source.nanoseconds()
                if remaining <= 0:
                    return True
                simulated = self._rclpy_source.get_ros_time_override_is_enabled()
                event.wait(None if simulated else remaining / S_TO_NS)
                event.clear()
        return False

    def sleep_for(self, rel_time: Duration, context: Context | None = None) -> bool:
        """Sleep for ``rel_time`` by this clock; see :meth:`sleep_until`."""
        return self.sleep_until(self.now() + rel_time, context)


class ROSClock(Clock):
    """ROS time: system time, or simulated time (``use_sim_time``)."""

    def __new__(cls) -> ROSClock:
        clock = super().__new__(cls, clock_type=ClockType.ROS_TIME)
        assert isinstance(clock, ROSClock)
        return clock

    @property
    def ros_time_is_active(self) -> bool:
        return self._rclpy_source.get_ros_time_override_is_enabled()

    def _set_ros_time_is_active(self, enabled: bool) -> None:
        self._rclpy_source.set_ros_time_override_is_enabled(enabled)

    def set_ros_time_override(self, time: Time) -> None:
        """Set the simulated time. Raises TypeError if ``time`` is not a :class:`~rclpy.time.Time`."""
        if not isinstance(time, Time):
            raise TypeError("Time must be specified as rclpy.time.Time")
        self._rclpy_source.set_ros_time_override(time)
