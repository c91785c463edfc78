"""What code finds here that was written for rclpy's C extension: its exceptions, and the signals' options."""

from __future__ import annotations

from typing import NoReturn

from rclpy import service_introspection
from rclpy.clock_type import ClockType
from rclpy.exceptions import (
    InvalidHandle,
    NodeNameNonExistentError,
    RCLError,
    RCLInvalidROSArgsError,
    RCUtilsError,
    RMWError,
    UnknownROSArgsError,
    UnsupportedEventTypeError,
)
from rclpy.qos import QoSCompatibility
from rclpy.signals import SignalHandlerOptions

__all__ = [
    "ClockType",
    "InvalidHandle",
    "NodeNameNonExistentError",
    "QoSCompatibility",
    "RCLError",
    "RCLInvalidROSArgsError",
    "RCUtilsError",
    "RMWError",
    "SignalHandlerOptions",
    "UnknownROSArgsError",
    "UnsupportedEventTypeError",
    "service_introspection",
]


def __getattr__(name: str) -> NoReturn:
    """:raises NotImplementedError: for everything else of the extension."""
    if name.startswith("__"):
        raise AttributeError(name)
    raise NotImplementedError(f"rclpy._rclpy_pybind11.{name}: this runtime has no C extension")
