"""Attributes that accept only values of a type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Checked(Generic[T]):
    """An attribute that accepts values of a type; an instance keeps it under its name with an underscore."""

    def __init__(
        self, kind: type[T], doc: str, also: type | None = None, make: Callable[[Any], T] | None = None
    ) -> None:
        """Create the attribute; ``make``, by default ``kind``, converts values of the type ``also``."""
        self._kind, self._also, self.__doc__ = kind, also, doc
        self._make: Callable[[Any], T] = make or kind

    def __set_name__(self, owner: type, name: str) -> None:
        self._name, self._slot = name, f"_{name}"

    def __get__(self, instance: Any, owner: type | None = None) -> T:
        return self if instance is None else getattr(instance, self._slot)  # type: ignore[return-value]

    def __set__(self, instance: Any, value: Any) -> None:
        if not isinstance(value, self._kind):
            if self._also is None or not isinstance(value, self._also):
                raise AssertionError(f"{self._name} must be a {self._kind.__name__}, not {value!r}")
            value = self._make(value)
        setattr(instance, self._slot, value)
