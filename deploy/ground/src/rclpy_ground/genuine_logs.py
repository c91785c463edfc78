"""Logging of an interpreter that is one process: the extension's, but for the arguments and ``/rosout``."""

from __future__ import annotations

from rclpy_ground.contexts import Context
from rclpy_ground.genuine import genuine
from rclpy_ground.logs import (
    publish,
    rclpy_logging_rosout_add_sublogger,
    rclpy_logging_rosout_remove_sublogger,
)

__all__ = [
    "rclpy_logging_configure",
    "rclpy_logging_rcutils_log",
    "rclpy_logging_rosout_add_sublogger",
    "rclpy_logging_rosout_remove_sublogger",
]


def rclpy_logging_configure(context: Context) -> None:
    genuine.rclpy_logging_configure(context.arguments.context)


def rclpy_logging_rcutils_log(
    severity: int, name: str, message: str, function: str, file: str, line: int
) -> None:
    genuine.rclpy_logging_rcutils_log(severity, name, message, function, file, line)
    publish(level=int(severity), name=name, msg=message, file=file, function=function, line=line)
