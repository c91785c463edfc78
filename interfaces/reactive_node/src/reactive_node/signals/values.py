"""Arithmetic of values: numbers, tuples of values, or whatever has ``+``, ``-`` and ``*``."""

from __future__ import annotations

from typing import Any


def between(a: Any, b: Any, ratio: float) -> Any:
    """Return a + (b - a) · ratio."""
    if isinstance(a, tuple):
        return _like(a, (between(p, q, ratio) for p, q in zip(a, b, strict=True)))
    return a + (b - a) * ratio


def slope(a: Any, b: Any, seconds: float) -> Any:
    """Return (b - a) / seconds."""
    if isinstance(a, tuple):
        return _like(a, (slope(p, q, seconds) for p, q in zip(a, b, strict=True)))
    return (b - a) / seconds


def trapezoid(sum_: Any, a: Any, b: Any, seconds: float) -> Any:
    """Return sum + (a + b) / 2 · seconds."""
    if isinstance(a, tuple):
        return _like(a, (trapezoid(*each, seconds) for each in zip(sum_, a, b, strict=True)))
    return sum_ + (a + b) / 2 * seconds


def _like(example: tuple[Any, ...], items: Any) -> Any:
    make = getattr(type(example), "_make", None)  # of a NamedTuple
    return tuple(items) if make is None else make(items)
