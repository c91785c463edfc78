"""The seam of the arm: what it asks the machine and supervisord for, and a simulation answers instead.

The kernel's clocks, threads and sockets of DDS are not here: they belong to the simulation of rclpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

replaceable_functions: list[Callable[..., Any]] = []
"""Those of the modules that were imported so far."""
_replacements: dict[Callable[..., Any], Callable[..., Any]] = {}


def replaceable(function: Callable[P, R]) -> Callable[P, R]:
    """Mark a function that a simulation replaces."""

    @wraps(function)
    def call(*arguments: P.args, **named: P.kwargs) -> R:
        result: R = _replacements.get(call, function)(*arguments, **named)
        return result

    replaceable_functions.append(call)
    return call


@contextmanager
def replaced(replacements: Mapping[Callable[..., Any], Callable[..., Any]]) -> Iterator[None]:
    """Call other functions in place of replaceable ones until the end of the ``with``."""
    _replacements.update(replacements)
    try:
        yield
    finally:
        _replacements.clear()
