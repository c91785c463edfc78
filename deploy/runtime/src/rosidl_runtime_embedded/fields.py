"""The Python values of fields: initial values, arrays and sequences of numbers, conversions.

As in rclpy, a sequence of numbers is an ``array.array``, an array of numbers is a ``numpy.ndarray``, every
other array or sequence is a list, and an octet is ``bytes`` of length 1. NumPy takes as long to import as
the rest of a node, so an array stays an ``array.array`` until its first read. And a long sequence of a
received message stays in the memory of DDS, as a memoryview, until its first read: a relay need not copy it.
"""

from __future__ import annotations

from array import array
from math import isinf
from reprlib import Repr
from threading import RLock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from .definition import Field, Literal

ARRAY_CODES = {
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float": "f",
    "double": "d",
}
"""Type codes of ``array`` and ``struct`` by the IDL name of a number."""

_SAME_NUMBERS = {"q": "ql", "Q": "QL"}
"""Type codes with the same meaning: NumPy has long where ARRAY_CODES has long long."""

_ZEROS: dict[str, Any] = {
    **dict.fromkeys(ARRAY_CODES, 0),
    "float": 0.0,
    "double": 0.0,
    "boolean": False,
    "octet": b"\0",
    "string": "",
    "wstring": "",
}


_repr = Repr()
_repr.maxstring = _repr.maxother = 100


def shown(value: object) -> str:
    """A short text of a value, of any size, for an error of one line."""
    return " ".join(_repr.repr(value).split())


def is_numeric(field: Field) -> bool:
    """Whether the field is an array or a sequence of numbers."""
    return field.type.is_plural and field.type.base in ARRAY_CODES


def slot_of(field: Field) -> str:
    """Name of the slot that holds the field's value. No field name begins or ends with an underscore."""
    return f"_{field.name}_" if is_numeric(field) else field.name


def python_value(base: str, value: Literal | tuple[Literal, ...]) -> Any:
    """A constant or default value, or a list of values, in Python."""
    if isinstance(value, tuple):
        return [python_value(base, element) for element in value]
    return bytes((int(value),)) if base == "octet" else value


def initial_value(field: Field, message_class: Callable[[str], type]) -> tuple[Any, bool]:
    """Initial value of the field, and whether it is a factory that makes the value."""
    type_ = field.type
    if type_.is_message:
        if type_.is_sequence:
            return list, True
        cls = message_class(type_.base)
        return ((lambda: [cls() for _ in range(type_.array_size)]) if type_.array_size else cls), True
    if not type_.is_plural:
        return _ZEROS[type_.base] if field.default is None else python_value(type_.base, field.default), False
    if field.default is None:
        values = [_ZEROS[type_.base]] * type_.array_size
    else:
        values = python_value(type_.base, field.default)
    if is_numeric(field):
        template = array(ARRAY_CODES[type_.base], values)
        return (lambda: template[:]), True
    return values.copy, True


def converter(type_name: str, field: Field) -> Callable[[Any], array[Any]]:
    """Function that converts a value to the ``array`` of a numeric field, or raises with a reason."""
    type_ = field.type
    code, size, bound = ARRAY_CODES[type_.base], type_.array_size, type_.sequence_bound

    def convert(value: Any) -> array[Any]:
        try:
            numbers = _to_array(code, value)
            if (size and len(numbers) != size) or len(numbers) > bound > 0:
                raise ValueError(f"it has {len(numbers)} elements")
        except (TypeError, ValueError, OverflowError) as error:
            kind = TypeError if isinstance(error, TypeError) else ValueError
            raise kind(
                f"{type_name}: field '{field.name}' must be {type_}, not {shown(value)}: {error}"
            ) from None
        return numbers

    return convert


def numeric_field(type_name: str, field: Field) -> property:
    """Property of an array or sequence of numbers, which converts or refuses assigned values."""
    slot, code, convert = slot_of(field), ARRAY_CODES[field.type.base], converter(type_name, field)

    def get_sequence(self: object) -> Any:
        value = getattr(self, slot)
        return _own_numbers(self, slot, code) if value.__class__ is memoryview else value

    def get_array(self: object) -> Any:
        value = getattr(self, slot)
        if isinstance(value, array):
            import numpy

            value = numpy.frombuffer(value, numpy.dtype(code))
            setattr(self, slot, value)
        return value

    def set_numbers(self: object, value: Any) -> None:
        setattr(self, slot, convert(value))

    return property(get_array if field.type.array_size else get_sequence, set_numbers)


_FIRST_READ = RLock()  # a signal handler may read a message while another one is copied


def _own_numbers(message: object, slot: str, code: str) -> Any:
    """Copy a sequence from the memory of DDS; threads that read it at the same time get one array."""
    with _FIRST_READ:
        numbers = getattr(message, slot)
        if isinstance(numbers, memoryview):
            lent, numbers = numbers, array(code)
            numbers.frombytes(lent.cast("B"))
            setattr(message, slot, numbers)
    return numbers


def _to_array(code: str, value: Any) -> array[Any]:
    if isinstance(value, array) and value.typecode == code:
        return value[:]  # a copy, as in rclpy: the caller may change the original
    try:
        view = memoryview(value)
    except TypeError:
        pass
    else:
        if view.ndim != 1:
            raise TypeError(f"it has {view.ndim} dimensions")
        if view.format in _SAME_NUMBERS.get(code, code):
            return array(code, view.tobytes())
    if code != "f" or isinstance(value, (bytes, bytearray)):
        return array(code, value)
    given = list(value)  # the values are read twice, which an iterator does not allow
    numbers = array(code, given)
    # array converts numbers beyond the range of a float to infinity
    if [number for number, source in zip(numbers, given, strict=True) if isinf(number) and not isinf(source)]:
        raise OverflowError("it has elements out of range")
    return numbers
