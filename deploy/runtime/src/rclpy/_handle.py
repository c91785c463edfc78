"""Handles: they represent entities in code that was written for rclpy's C layer."""

from __future__ import annotations

from types import TracebackType
from typing import Generic, TypeVar

_Entity = TypeVar("_Entity")


class Handle:
    """An entity, or its representative, as the subject of a ``with``.

    In rclpy, the ``with`` delays the destruction of the entity. Here the destruction of an entity in use is
    safe, so the ``with`` does nothing.
    """

    def __enter__(self) -> None:
        """Do nothing."""

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        """Do nothing."""


class EntityHandle(Handle, Generic[_Entity]):
    """A handle with which waitables add an entity to a wait set."""

    def __init__(self, entity: _Entity) -> None:
        self._rclpy_entity = entity


def ignore_change() -> None:
    """Do nothing: no executor waits for the timer or guard condition that has changed."""
