"""The default context, and small helpers."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from rclpy import _arguments
from rclpy.constants import S_TO_NS
from rclpy.context import Context

g_default_context: Context | None = None
g_context_lock = threading.Lock()


def get_default_context(*, shutting_down: bool = False) -> Context:
    """
    Return the context that is used where none is given, making it if need be.

    :param shutting_down: hand it over for the last time; the next call makes a new one.
    """
    global g_default_context
    with g_context_lock:
        if g_default_context is None:
            g_default_context = Context()
        if shutting_down:
            context, g_default_context = g_default_context, None
            return context
        return g_default_context


def remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    """Return ``args`` (``sys.argv`` if ``None``) without what is for ROS."""
    return _arguments.remove_ros_args(None if args is None else list(args))


def ok(*, context: Context | None = None) -> bool:
    """Whether ``context`` (the default one if ``None``) runs."""
    return (get_default_context() if context is None else context).ok()


def shutdown(*, context: Context | None = None) -> None:
    """Shut ``context`` (the default one if ``None``) down; raises RuntimeError if it does not run."""
    (get_default_context(shutting_down=True) if context is None else context).shutdown()


def try_shutdown(*, context: Context | None = None) -> None:
    """
    Shut ``context`` (the default one if ``None``) down, unless that has happened already.

    There is a new default context afterwards, also where a signal has shut the old one down.
    """
    (get_default_context(shutting_down=True) if context is None else context).try_shutdown()


def get_rmw_implementation_identifier() -> str:
    """The middleware: always Cyclone DDS here."""
    return "rmw_cyclonedds_cpp"


def get_available_rmw_implementations() -> set[str]:
    """The middlewares one can choose from."""
    return {get_rmw_implementation_identifier()}


def timeout_sec_to_nsec(timeout_sec: float | None) -> int:
    """A timeout in seconds (``None`` or negative: for ever) as nanoseconds (-1: for ever)."""
    if timeout_sec is None or timeout_sec < 0:
        return -1
    return int(float(timeout_sec) * S_TO_NS)
