"""Handles: what stands for an entity in code that was written for rclpy's C layer."""

from __future__ import annotations

from types import TracebackType


class Handle:
    """
    An entity, or what stands for it, as the subject of a ``with``.

    In rclpy the ``with`` keeps the entity from being destroyed meanwhile. Here nothing breaks when it is, so
    the ``with`` does nothing.
    """

    def __enter__(self) -> None:
        """Begin to use it."""

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        """Use it no longer."""
