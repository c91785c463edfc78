"""Loggers and their levels."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rclpy.impl import _logging_levels, _logging_output, rcutils_logger
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.impl.rcutils_logger import RcutilsLogger

__all__ = [
    "LoggingSeverity",
    "RcutilsLogger",
    "clear_config",
    "get_logger",
    "get_logger_effective_level",
    "get_logger_level",
    "get_logging_directory",
    "get_logging_severity_from_string",
    "initialize",
    "set_logger_level",
    "shutdown",
]

if TYPE_CHECKING:
    from pathlib import Path

    from rclpy._arguments import RosArguments

_root_logger = RcutilsLogger()


def get_logger(name: str) -> RcutilsLogger:
    """Return a logger with that name. Raises ValueError if `name` is empty."""
    if not name:
        raise ValueError("Logger name must not be empty.")
    return _root_logger.get_child(name)


def initialize() -> None:
    """Configure logging from the environment, once. Raises RuntimeError if a variable is invalid."""
    _logging_output.initialize()


def shutdown() -> None:
    """Reset logging: the levels, and the configuration from the environment."""
    _logging_output.shutdown()
    _logging_levels.clear()


def clear_config() -> None:
    """Reset all levels, and configure logging from the environment again."""
    shutdown()
    initialize()


def set_logger_level(name: str, level: int | LoggingSeverity, detailed_error: bool = False) -> None:
    """Set a logger's level, or with '' the default. Raises ValueError, with its reason in any case."""
    _logging_levels.set_level(name, LoggingSeverity(level))


def get_logger_effective_level(name: str) -> LoggingSeverity:
    """Return the effective level of the logger `name`: its own, or that of an ancestor."""
    return LoggingSeverity(_logging_levels.effective_level(name))


def get_logger_level(name: str) -> LoggingSeverity:
    """Return the level that was set for the logger `name` itself, or UNSET."""
    return LoggingSeverity(_logging_levels.get_level(name))


def get_logging_severity_from_string(log_severity: str) -> LoggingSeverity:
    """Return the severity with that name, in upper or lower case. Raises RuntimeError if there is none."""
    try:
        return LoggingSeverity[log_severity.upper()]
    except KeyError:
        raise RuntimeError(f"Failed to get severity name: '{log_severity}' is not a severity") from None


def get_logging_directory() -> Path:
    """Return the directory for log files: `$ROS_LOG_DIR`, else `$ROS_HOME/log`, else `~/.ros/log`."""
    from pathlib import Path

    directory = os.environ.get("ROS_LOG_DIR") or os.path.join(os.environ.get("ROS_HOME") or "~/.ros", "log")
    return Path(directory).expanduser()


def _apply_arguments(arguments: RosArguments) -> None:
    """Configure logging from environment and command line. Raises RuntimeError if a variable is invalid."""
    initialize()
    _logging_output.enable_console(arguments.stdout_logs)
    if arguments.log_level is not None:
        _logging_levels.set_level("", arguments.log_level)
    for name, level in arguments.log_levels.items():
        _logging_levels.set_level(name, level)


rcutils_logger._internal_callers.append(__file__)
