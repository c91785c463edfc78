"""The ROS parameters of a service, declared as a dataclass.

A service states its parameters once::

    @dataclass(frozen=True)
    class Parameters:
        rate: float = parameter(20.0, (1.0, 100.0), "Hz", "heartbeats while the switch is pressed")

:meth:`interfaces.service.ServiceNode.declare` declares them on the node and returns their values. The
parameter check before a start and the README's table read the same dataclass.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T", bool, int, float, str)
_TYPES = {bool: "true or false", int: "an integer", float: "a number with a decimal point", str: "a string"}


class Declaration(NamedTuple):
    name: str
    default: Any
    within: tuple[Any, Any] | None
    """The least and the greatest allowed value; ``None`` if the parameter has no range."""
    unit: str
    meaning: str
    settable: bool
    """Whether the value may change while the service runs."""

    def problem(self, value: object) -> str:
        """Return why the parameter cannot have this value; empty if it can."""
        if type(value) is not type(self.default):
            return f"must be {_TYPES[type(self.default)]}, not {value!r}"
        if self.within and not self.within[0] <= value <= self.within[1]:
            return f"must be from {self.within[0]:g} to {self.within[1]:g}, not {value!r}"
        return ""


def parameter(
    default: T, within: tuple[T, T] | None, unit: str, meaning: str, *, settable: bool = False
) -> T:
    """Return the dataclass field of a parameter: see :class:`Declaration`."""
    field: T = dataclasses.field(
        default=default,
        metadata={"within": within, "unit": unit, "meaning": meaning, "settable": settable},
    )
    return field


def declarations(parameters: type) -> Iterator[Declaration]:
    """Yield what a dataclass of parameters declares, in order."""
    for field in dataclasses.fields(parameters):
        yield Declaration(field.name, field.default, **field.metadata)
