"""Stand-ins for what rclpy has and this runtime has not: who uses it learns by its name what is missing."""

from __future__ import annotations

from typing import Any, Self


class NotThere:
    """Base of the stand-ins for classes: they can be imported and subclassed, but have no instances."""

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """Refuse. Raises NotImplementedError, which names the class of rclpy."""
        missing = next(base for base in cls.__mro__ if NotThere in base.__bases__)
        raise NotImplementedError(text(missing))


def text(missing: Any) -> str:
    """Say in a line that a class or function of rclpy is not there."""
    return (
        f"{missing.__module__}.{missing.__name__}: the embedded runtime has no actions and no lifecycle nodes"
    )
