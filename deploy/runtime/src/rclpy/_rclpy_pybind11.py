"""The exceptions and enumerations of rclpy's C extension, for code that imports them from it."""

from __future__ import annotations

from typing import Any

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


def __getattr__(name: str) -> Any:
    """Return enumerations, and guard conditions for waitables. Raises NotImplementedError for all others."""
    if name.startswith("__"):
        raise AttributeError(name)
    if name == "GuardCondition":
        return _guard_condition
    if name == "GoalEvent":
        from rclpy.action.server import GoalEvent

        return GoalEvent
    if name == "TransitionCallbackReturnType":
        from rclpy.lifecycle import TransitionCallbackReturn

        return TransitionCallbackReturn
    raise NotImplementedError(f"rclpy._rclpy_pybind11.{name}: this runtime has no C extension")


def _guard_condition(context: object) -> Any:
    from rclpy.guard_condition import GuardCondition

    return GuardCondition(callback=None, callback_group=None).handle
