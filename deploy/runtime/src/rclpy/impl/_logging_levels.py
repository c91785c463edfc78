"""The levels of all loggers: a tree with dots in the names.

A logger without a level has the level of its nearest ancestor that has one, or else the default level.
"""

from __future__ import annotations

from threading import Lock

from rclpy.impl.logging_severity import LoggingSeverity

_lock = Lock()
_default = int(LoggingSeverity.INFO)
_levels: dict[str, int] = {}
# Cached effective levels. Replaced, never cleared: if another thread changes a level during a computation,
# the stale result goes into the old dictionary.
_effective: dict[str, int] = {}


def set_level(name: str, level: int) -> None:
    """Set the level of a logger; '' sets the default level."""
    global _default, _effective
    with _lock:
        _levels[name] = level
        if not name:
            _default = level
        _effective = {}


def get_level(name: str) -> int:
    """Return the level that was set for this logger itself, or UNSET; for '', the default level."""
    return _levels.get(name, int(LoggingSeverity.UNSET)) if name else _default


def effective_level(name: str) -> int:
    """Return the level that applies to the messages of a logger."""
    effective = _effective
    level = effective.get(name)
    if level is None:
        level = effective[name] = _inherited_level(name)
    return level


def clear() -> None:
    """Reset all levels; the default is INFO."""
    global _default, _effective
    with _lock:
        _levels.clear()
        _default = int(LoggingSeverity.INFO)
        _effective = {}


def _inherited_level(name: str) -> int:
    while name:
        if level := _levels.get(name):
            return level
        name = name.rpartition(".")[0]
    return _default
