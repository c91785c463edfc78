"""The default context, and helper functions."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from rclpy import _arguments
from rclpy.constants import S_TO_NS
from rclpy.context import Context

g_default_context: Context | None = None
g_context_lock = threading.Lock()


def get_default_context(*, shutting_down: bool = False) -> Context:
    """Return the default context; after a call with ``shutting_down``, the next one creates a new one."""
    global g_default_context
    with g_context_lock:
        if g_default_context is None:
            g_default_context = Context()
        if shutting_down:
            context, g_default_context = g_default_context, None
            return context
        return g_default_context


def remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    """Return ``args`` (``sys.argv`` if ``None``) without ROS arguments."""
    return _arguments.remove_ros_args(None if args is None else list(args))


def ok(*, context: Context | None = None) -> bool:
    """Return whether ``context`` (by default the default one) is initialized and not shut down."""
    return (get_default_context() if context is None else context).ok()


def shutdown(*, context: Context | None = None) -> None:
    """Shut down ``context`` (by default the default one). Raises RuntimeError if it does not run."""
    (get_default_context(shutting_down=True) if context is None else context).shutdown()


def try_shutdown(*, context: Context | None = None) -> None:
    """Shut down ``context`` (by default the default one) unless it is already shut down.

    The next default context is a new one, even after a shutdown by a signal.
    """
    (get_default_context(shutting_down=True) if context is None else context).try_shutdown()


def get_rmw_implementation_identifier() -> str:
    """Return the name of the middleware: always Cyclone DDS."""
    return "rmw_cyclonedds_cpp"


def get_available_rmw_implementations() -> set[str]:
    return {get_rmw_implementation_identifier()}


def timeout_sec_to_nsec(timeout_sec: float | None) -> int:
    """Convert a timeout [s] (``None`` or negative: no limit) to nanoseconds (-1: no limit)."""
    if timeout_sec is None or timeout_sec < 0:
        return -1
    return int(float(timeout_sec) * S_TO_NS)
