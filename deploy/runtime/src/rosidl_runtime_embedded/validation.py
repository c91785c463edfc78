"""Why a message cannot be serialized, or a field not be assigned a value: the slow, exact checks."""

from __future__ import annotations

from array import array
from collections import UserList, UserString
from collections.abc import Sequence, Set
from operator import index
from struct import Struct
from typing import TYPE_CHECKING, Any

from .definition import integer_range
from .fields import ARRAY_CODES, is_numeric, shown

if TYPE_CHECKING:
    from .definition import Field, FieldType


def validate(message: object, cls: Any) -> None:
    """Raise TypeError or ValueError, naming type, field and value, if it is no valid message of a class."""
    if not isinstance(message, cls):
        raise TypeError(f"a {cls._TYPE_NAME} is expected, not {shown(message)}")
    _message(message, cls._TYPE_NAME, "")


def validate_assignment(value: object, field: Field, top: str) -> None:
    """Raise TypeError or ValueError if a field may not be assigned the value where fields are checked.

    A nested message has to be of the right class: its own fields are its own affair.
    """
    type_ = field.type
    if not type_.is_plural:
        _single(value, type_, top, field.name, nested=False)
    elif not (is_numeric(field) and _is_array(value, type_, top, field.name)):
        _list(value, type_, top, field.name, nested=False)


def _is_array(value: object, type_: FieldType, top: str, where: str) -> bool:
    """Whether it is what rclpy holds such numbers in, and not to be looked at one by one."""
    code = ARRAY_CODES[type_.base]
    if type_.array_size:
        import numpy

        return isinstance(value, numpy.ndarray) and value.dtype == numpy.dtype(code)
    if isinstance(value, array) and value.typecode != code:
        raise _wrong(TypeError, top, where, type_, value, f"its type code is not '{code}'")
    return isinstance(value, array)


def _message(message: Any, top: str, path: str) -> None:
    for field in message._DEFINITION.fields:
        where = f"{path}{field.name}"
        try:
            value = getattr(message, field.name)
        except AttributeError:
            raise TypeError(f"{top}: field '{where}' is not set") from None
        if is_numeric(field):
            # the property has converted it, but an array.array can be changed afterwards
            if len(value) > field.type.sequence_bound > 0:
                raise _wrong(ValueError, top, where, field.type, value)
        elif field.type.is_plural:
            _list(value, field.type, top, where)
        else:
            _single(value, field.type, top, where)


def _wrong(
    kind: type[Exception], top: str, where: str, type_: FieldType, value: object, reason: str = ""
) -> Exception:
    return kind(f"{top}: field '{where}' must be {type_}, not {shown(value)}{reason and ': ' + reason}")


def elements(value: Any, base: str) -> list[Any]:
    """What rclpy publishes of a value as a list of the base type. Raises TypeError if it is no such thing."""
    if getattr(value, "ndim", 0) == 1:  # a NumPy array or the like
        value = value.tobytes() if base == "octet" and value.itemsize == 1 else value.tolist()
    if base == "octet" and isinstance(value, (bytes, bytearray)):
        return [bytes((octet,)) for octet in value]
    return _as_list(value)


def _as_list(value: Any) -> list[Any]:
    if not isinstance(value, (Sequence, Set, UserList)) or isinstance(value, (str, UserString)):
        raise TypeError("it is no list")
    return list(value)


def _list(given: Any, type_: FieldType, top: str, where: str, nested: bool = True) -> None:
    try:
        # rclpy is more particular about what is assigned than about what is published
        value = elements(given, type_.base) if nested else _as_list(given)
    except TypeError as error:
        raise _wrong(TypeError, top, where, type_, given, str(error)) from None
    if (type_.array_size and len(value) != type_.array_size) or len(value) > type_.sequence_bound > 0:
        raise _wrong(ValueError, top, where, type_, given, f"it has {len(value)} elements")
    element_type = type_._replace(array_size=0, is_sequence=False, sequence_bound=0)
    for number, element in enumerate(value):
        _single(element, element_type, top, f"{where}[{number}]", nested)


def _single(value: Any, type_: FieldType, top: str, where: str, nested: bool = True) -> None:
    base = type_.base
    if type_.is_message:
        if getattr(type(value), "_TYPE_NAME", None) != base:
            raise _wrong(TypeError, top, where, type_, value)
        if nested:
            _message(value, top, f"{where}.")
    elif base in ("string", "wstring"):
        _string(value, type_, top, where)
    elif base == "boolean":
        if not isinstance(value, bool):
            raise _wrong(TypeError, top, where, type_, value)
    elif base == "octet":
        if not isinstance(value, bytes):
            raise _wrong(TypeError, top, where, type_, value)
        if len(value) != 1:
            raise _wrong(ValueError, top, where, type_, value, "it must have length 1")
    elif base in ("float", "double"):
        if not isinstance(value, float):
            raise _wrong(TypeError, top, where, type_, value)
        if base == "float":
            try:
                Struct("<f").pack(value)
            except OverflowError:
                raise _wrong(ValueError, top, where, type_, value, "it is out of range") from None
    else:
        if not isinstance(value, int):
            # rclpy publishes whatever is an integer, such as NumPy's; only a check of fields refuses it.
            if not nested or not hasattr(value, "__index__"):
                raise _wrong(TypeError, top, where, type_, value)
            value = index(value)
        low, high = integer_range(base)
        if not low <= value <= high:
            raise _wrong(ValueError, top, where, type_, value, f"it must be in [{low}, {high}]")


def _string(value: Any, type_: FieldType, top: str, where: str) -> None:
    if not isinstance(value, str):
        raise _wrong(TypeError, top, where, type_, value)
    if len(value) > type_.string_bound > 0:
        raise _wrong(ValueError, top, where, type_, value, f"it has {len(value)} characters")
    if type_.base == "string" and "\0" in value:
        raise _wrong(ValueError, top, where, type_, value, "it contains a NUL")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise _wrong(ValueError, top, where, type_, value, str(error)) from None
