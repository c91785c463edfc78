"""The logger that `rclpy.logging.get_logger` and `Node.get_logger` return."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any

from rclpy.clock_type import ClockType
from rclpy.impl import _logging_levels, _logging_output
from rclpy.impl.logging_severity import LoggingSeverity

_SEPARATOR = "."
# Logging code: the caller is the first frame that is not in these files.
_internal_callers = [__file__]


def _find_caller(frame: FrameType) -> FrameType:
    caller: FrameType | None = frame
    while caller is not None and caller.f_code.co_filename in _internal_callers:
        caller = caller.f_back
    return caller or frame


class _Filters:
    """The filters of a logging call in the source, in this order: throttle, skip first, once."""

    __slots__ = ("_last", "_logged", "_skipped", "name", "options", "severity")

    OPTIONS = ("throttle_duration_sec", "throttle_time_source_type", "skip_first", "once")

    def __init__(self, severity: LoggingSeverity, name: str, options: dict[str, Any]) -> None:
        """Read the keyword `options` of a call. Raises ValueError if the time source is not a clock."""
        self.severity = severity
        self.name = name
        self.options = options
        # As in rclpy: with a given clock, time 0 counts as the last message.
        self._last = 0 if options.get("throttle_time_source_type") else -sys.maxsize
        self._skipped = False
        self._logged = False
        clock = options.get("throttle_time_source_type")
        if options.get("throttle_duration_sec") and clock is not None and not _is_clock(clock):
            raise ValueError(f'Received throttle_time_source_type of "{clock}" is not a clock instance')

    def check_unchanged(self, severity: LoggingSeverity, name: str, options: dict[str, Any]) -> None:
        """Check that the call has the same arguments as before. Raises ValueError if it does not."""
        if severity != self.severity:
            raise ValueError("Logger severity cannot be changed between calls.")
        if name != self.name:
            raise ValueError("Logger name cannot be changed between calls.")
        if options != self.options:
            if _requested(options) != _requested(self.options):
                raise ValueError("Requested logging filters cannot be changed between calls.")
            raise ValueError("Logging filter parameters cannot be changed between calls.")

    def should_log(self) -> bool:
        """Return whether to log; filters before the rejecting one have updated their state."""
        options = self.options
        if duration := options.get("throttle_duration_sec"):
            clock = options.get("throttle_time_source_type")
            # Steady time by default: setting the wall clock has no effect.
            now = time.monotonic_ns() if clock is None else clock.now().nanoseconds
            if now < self._last + duration * 1e9:
                return False
            self._last = now
        if options.get("skip_first") and not self._skipped:
            self._skipped = True
            return False
        if options.get("once"):
            if self._logged:
                return False
            self._logged = True
        return True


def _is_clock(value: Any) -> bool:
    # Not isinstance(value, Clock): the module of clocks imports that of contexts, and that one logging.
    return isinstance(getattr(value, "clock_type", None), ClockType) and hasattr(value, "now")


def _requested(options: dict[str, Any]) -> set[str]:
    return {option.split("_")[0] for option, value in options.items() if value}


def _check_options(options: dict[str, Any]) -> None:
    """Check a call's keywords. Raises TypeError if one is unknown or a required one is missing."""
    for option in options:
        if option not in _Filters.OPTIONS:
            raise TypeError(
                f'parameter "{option}" is not one of the recognized logging options '
                f'"{list(_Filters.OPTIONS)}"'
            )
    if options.get("throttle_time_source_type") and "throttle_duration_sec" not in options:
        raise TypeError(
            'required parameter "throttle_duration_sec" not specified but is required for the the logging '
            'filter "throttle"'
        )


class RcutilsLogger:
    """Logs messages under a name; names form a tree, with dots.

    Filters apply to each logging call in the source separately: `once=True`, `skip_first=True`,
    `throttle_duration_sec=` [s] with the optional clock `throttle_time_source_type=`.
    """

    def __init__(self, name: str = "") -> None:
        self.name = name
        # Position of a call in the source -> its filters.
        self.contexts: dict[tuple[CodeType, int], _Filters] = {}
        self._rclpy_shared_publisher: Callable[[_logging_output.LogRecord], None] | None = None

    def __del__(self) -> None:
        if self._rclpy_shared_publisher is not None:
            _logging_output.unshare_rosout_publisher(self.name, self._rclpy_shared_publisher)

    def get_child(self, name: str) -> RcutilsLogger:
        """Return the logger `name` below this one. Raises ValueError if `name` is empty."""
        if not name:
            raise ValueError("Child logger name must not be empty.")
        if not self.name:
            return RcutilsLogger(name)
        child = RcutilsLogger(self.name + _SEPARATOR + name)
        child._rclpy_shared_publisher = _logging_output.share_rosout_publisher(self.name, child.name)
        return child

    def set_level(self, level: int | LoggingSeverity) -> None:
        """Set the lowest level to log; UNSET: that of the parent. Raises ValueError if it is no severity."""
        _logging_levels.set_level(self.name, LoggingSeverity(level))

    def get_effective_level(self) -> LoggingSeverity:
        """Return the effective level: this logger's own, or that of an ancestor."""
        return LoggingSeverity(_logging_levels.effective_level(self.name))

    def is_enabled_for(self, severity: int | LoggingSeverity) -> bool:
        """Return whether messages of `severity` are logged. Raises ValueError if it is no severity."""
        return LoggingSeverity(severity) >= _logging_levels.effective_level(self.name)

    def log(self, message: str, severity: int | LoggingSeverity, **kwargs: Any) -> bool:
        """Log `message`, unless the level or a filter rejects it.

        :param kwargs: filters (see the class), and `name` to log under another name.
        :returns: whether it was logged.
        :raises TypeError: if `message` is not a string, or a filter is unknown.
        :raises ValueError: if a filter's value is invalid, or the same call had other arguments before.
        """
        if severity.__class__ is not LoggingSeverity:
            severity = LoggingSeverity(severity)
        if severity < _logging_levels.effective_level(self.name):
            return False
        name = kwargs.pop("name", self.name) if kwargs else self.name
        if kwargs:
            _check_options(kwargs)
        if message is None or isinstance(message, bytes):  # rclpy accepts these, too
            message = "(null)" if message is None else message.decode(errors="replace")
        if not isinstance(message, str):
            raise TypeError(f"a log message must be a str, not {type(message).__name__}: {message!r}")

        frame = _find_caller(sys._getframe(1))
        code = frame.f_code
        # The position in the bytecode distinguishes two calls on one line.
        place = (code, frame.f_lasti)
        filters = self.contexts.get(place)
        if filters is None:
            filters = self.contexts.setdefault(place, _Filters(severity, name, kwargs))
        else:
            filters.check_unchanged(severity, name, kwargs)
        if kwargs and not filters.should_log():
            return False
        _logging_output.output(
            _logging_output.LogRecord(
                time.time_ns(), int(severity), name, message, code.co_filename, code.co_name, frame.f_lineno
            )
        )
        return True

    def debug(self, message: str, **kwargs: Any) -> bool:
        return self.log(message, LoggingSeverity.DEBUG, **kwargs)

    def info(self, message: str, **kwargs: Any) -> bool:
        return self.log(message, LoggingSeverity.INFO, **kwargs)

    def warning(self, message: str, **kwargs: Any) -> bool:
        return self.log(message, LoggingSeverity.WARN, **kwargs)

    def warn(self, message: str, **kwargs: Any) -> bool:
        """Log with severity WARN: the old name of `warning`."""
        return self.warning(message, **kwargs)

    def error(self, message: str, **kwargs: Any) -> bool:
        return self.log(message, LoggingSeverity.ERROR, **kwargs)

    def fatal(self, message: str, **kwargs: Any) -> bool:
        return self.log(message, LoggingSeverity.FATAL, **kwargs)
