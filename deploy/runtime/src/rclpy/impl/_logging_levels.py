"""
The levels of all loggers: a tree whose branches are named with dots.

A logger whose level is unset has that of its nearest ancestor with a level, else the default level.
"""

from __future__ import annotations

from threading import Lock

from rclpy.impl.logging_severity import LoggingSeverity

_lock = Lock()
_default = int(LoggingSeverity.INFO)
_levels: dict[str, int] = {}
# Effective levels that were asked for. Replaced, never cleared: a thread that computes a level while another
# one changes it leaves its stale answer in the old dictionary.
_effective: dict[str, int] = {}


def set_level(name: str, level: int) -> None:
    """Set the level of a logger; '' names the default level."""
    global _default, _effective
    with _lock:
        _levels[name] = level
        if not name:
            _default = level
        _effective = {}


def get_level(name: str) -> int:
    """Return the level set for exactly this logger, UNSET if there is none; '' names the default level."""
    return _levels.get(name, int(LoggingSeverity.UNSET)) if name else _default


def effective_level(name: str) -> int:
    """Return the level that decides about the messages of a logger."""
    effective = _effective
    level = effective.get(name)
    if level is None:
        level = effective[name] = _inherited_level(name)
    return level


def clear() -> None:
    """Forget all levels; the default is INFO again."""
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
