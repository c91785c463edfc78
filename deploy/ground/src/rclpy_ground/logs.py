"""Logging of processes that share an interpreter: each has its own standard error, levels and ``/rosout``."""

from __future__ import annotations

import itertools
import sys
import time
from typing import Any

from rclpy_ground import process
from rclpy_ground.genuine import genuine

_NAMES = {10: "DEBUG", 20: "INFO", 30: "WARN", 40: "ERROR", 50: "FATAL"}
_UNSET = 0


def rclpy_logging_configure(context: Any) -> None:
    for option, value in itertools.pairwise(sys.argv):
        if option == "--log-level":
            name, _, level = value.rpartition(":=")
            rclpy_logging_set_logger_level(
                name, genuine.rclpy_logging_severity_level_from_string(level.upper())
            )


def rclpy_logging_fini() -> None:
    """Do nothing: there are no log files to close."""


def rclpy_logging_initialize() -> None:
    """Do nothing: a process begins with its levels."""


def rclpy_logging_shutdown() -> None:
    process.current.levels.clear()
    process.current.default_level = process.INFO


def rclpy_logging_set_logger_level(name: str, level: int, detailed_error: bool = False) -> None:
    if name:
        process.current.levels[name] = int(level)
    else:
        process.current.default_level = int(level)


def rclpy_logging_get_logger_level(name: str) -> int:
    return process.current.levels.get(name, _UNSET) if name else process.current.default_level


def rclpy_logging_get_logger_effective_level(name: str) -> int:
    """Return the level of a logger, or of the nearest parent that has one."""
    levels = process.current.levels
    while levels and name:
        if level := levels.get(name):
            return level
        name = name.rpartition(".")[0]
    return process.current.default_level


def rclpy_logging_logger_is_enabled_for(name: str, severity: int) -> bool:
    return int(severity) >= rclpy_logging_get_logger_effective_level(name)


def rclpy_logging_rosout_add_sublogger(name: str, child: str) -> bool:
    current = process.current
    if name not in current.rosout:
        return False
    full = f"{name}.{child}"
    publisher, users = current.subloggers.get(full, (current.rosout[name], 0))
    current.subloggers[full] = publisher, users + 1
    return True


def rclpy_logging_rosout_remove_sublogger(name: str, child: str) -> None:
    subloggers = process.current.subloggers
    if (found := subloggers.pop(f"{name}.{child}", None)) is not None and found[1] > 1:
        subloggers[f"{name}.{child}"] = found[0], found[1] - 1


def rclpy_logging_rcutils_log(
    severity: int, name: str, message: str, function: str, file: str, line: int
) -> None:
    now, level = time.time_ns(), int(severity)
    stamp = f"{now // 1_000_000_000:010d}.{now % 1_000_000_000:09d}"
    print(f"[{_NAMES[level]}] [{stamp}] [{name}]: {message}", file=sys.stderr)
    publish(now, level=level, name=name, msg=message, file=file, function=function, line=line)


def publish(now: int | None = None, **fields: Any) -> None:
    """Publish a message on ``/rosout``, if the node of its logger has it."""
    publisher = _publisher_of(fields["name"])
    if publisher is not None and publisher.is_wanted and publisher.node.context.is_valid:
        publisher.publish(_message(time.time_ns() if now is None else now, **fields))


def _publisher_of(name: str) -> Any:
    current = process.current
    reference = current.rosout.get(name) or current.subloggers.get(name, (None,))[0]
    return reference() if reference else None


def _message(now: int, **fields: Any) -> Any:
    from builtin_interfaces.msg import Time
    from rcl_interfaces.msg import Log

    seconds, nanoseconds = divmod(now, 1_000_000_000)
    return Log(stamp=Time(sec=seconds, nanosec=nanoseconds), **fields)
