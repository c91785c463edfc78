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
import reprlib
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeVar

from rclpy.parameter import Parameter

T = TypeVar("T")
_TYPES = {
    Parameter.Type.BOOL: "true or false",
    Parameter.Type.INTEGER: "an integer",
    Parameter.Type.DOUBLE: "a number with a decimal point",
    Parameter.Type.STRING: "a string",
    Parameter.Type.BOOL_ARRAY: "a list of true and false",
    Parameter.Type.INTEGER_ARRAY: "a list of integers",
    Parameter.Type.DOUBLE_ARRAY: "a list of numbers with a decimal point",
    Parameter.Type.STRING_ARRAY: "a list of strings",
}
_WITH_RANGE = (Parameter.Type.INTEGER, Parameter.Type.DOUBLE)


class Declaration(NamedTuple):
    name: str
    default: Any
    """Its value where none is given; or its type, and then it has no value where none is given."""
    within: tuple[Any, Any] | None
    """The least and the greatest allowed value; ``None`` if the parameter has no range."""
    unit: str
    meaning: str
    settable: bool
    """Whether the value may change while the service runs."""

    @property
    def type(self) -> Parameter.Type:
        return _type_by_default(self.default)

    def problem(self, value: object) -> str:
        """Return why the parameter cannot have this value; empty if it can."""
        if _type_of(value) is not self.type:
            return f"must be {_TYPES[self.type]}, not {reprlib.repr(value)}"
        if self.within and not self.within[0] <= value <= self.within[1]:
            return f"must be from {self.within[0]:g} to {self.within[1]:g}, not {reprlib.repr(value)}"
        return ""


def parameter(
    default: T, within: tuple[T, T] | None, unit: str, meaning: str, *, settable: bool = False
) -> T:
    """Return the dataclass field of a parameter: see :class:`Declaration`.

    A list of values has a tuple as its default, and no range.

    :raises TypeError: if no parameter file can hold a value of that type, for example of an empty list.
    """
    found = _type_by_default(default)
    if found not in _TYPES or (within and found not in _WITH_RANGE):
        raise TypeError(
            f"{default!r} cannot be the default of a parameter{' with a range' if within else ''}"
        )
    field: T = dataclasses.field(
        default=default,
        metadata={"within": within, "unit": unit, "meaning": meaning, "settable": settable},
    )
    return field


def _type_by_default(default: object) -> Parameter.Type:
    """Return the type of a parameter by its default; see :class:`Declaration`."""
    return default if isinstance(default, Parameter.Type) else _type_of(default)


def _type_of(value: object) -> Parameter.Type:
    """Return the type of a value; none of `_TYPES` if no parameter file can show it, as of an empty list."""
    try:
        found: Parameter.Type = Parameter.Type.from_parameter_value(value)
    except TypeError:
        return Parameter.Type.NOT_SET
    return found


def declarations(parameters: type) -> Iterator[Declaration]:
    """Yield what a dataclass of parameters declares, in order."""
    for field in dataclasses.fields(parameters):
        yield Declaration(field.name, field.default, **field.metadata)
