"""Sets the fields of messages from plain values, such as those of a YAML file."""

from __future__ import annotations

import array
from collections.abc import Callable
from functools import partial
from typing import Any

from rosidl_parser.definition import AbstractGenericString, AbstractNestedType, NamespacedType

import ros_yaml
from rosidl_runtime_py.convert import get_message_slot_types
from rosidl_runtime_py.utilities import get_message

_HEADER = ("std_msgs", "msg", "Header")
_TIME = ("builtin_interfaces", "msg", "Time")


def set_message_fields(
    msg: Any, values: dict[str, Any], expand_header_auto: bool = False, expand_time_now: bool = False
) -> list[Callable[[Any], None]]:
    """Set fields of a message from a dictionary by their names.

    :param expand_header_auto: whether a ``std_msgs/Header`` may be ``auto``: its stamp is set later.
    :param expand_time_now: whether a ``builtin_interfaces/Time`` may be ``now``: it is set later.
    :return: functions that set the times that are set later, each to its argument.
    :raises AttributeError: if the message has no such field.
    :raises TypeError, ValueError: if a value does not fit its field.
    """
    if not isinstance(values, dict):
        kind = type(values).__name__
        raise TypeError(f"Value '{values}' is expected to be a dictionary but is a {kind}")
    later: list[Callable[[Any], None]] = []

    def message(type_: Any, fields: Any) -> Any:
        made = type_()
        later.extend(set_message_fields(made, fields, expand_header_auto, expand_time_now))
        return made

    types = get_message_slot_types(msg)
    for name, value in values.items():
        current = getattr(msg, name)
        slot = types.get(name)
        is_time = isinstance(slot, NamespacedType) and slot.namespaced_name() == _TIME
        is_header = isinstance(slot, NamespacedType) and slot.namespaced_name() == _HEADER
        if is_header and expand_header_auto and value == "auto":
            later.append(partial(setattr, current, "stamp"))
        elif is_time and expand_time_now and value == "now":
            later.append(partial(setattr, msg, name))
        elif isinstance(slot, NamespacedType):
            given = isinstance(value, type(current))
            setattr(msg, name, value if given else message(type(current), value))
        elif isinstance(slot, AbstractNestedType) and isinstance(slot.value_type, NamespacedType):
            element = get_message("/".join(slot.value_type.namespaced_name()))
            setattr(msg, name, [message(element, fields) for fields in value])
        else:
            element = slot.value_type if isinstance(slot, AbstractNestedType) else slot
            setattr(msg, name, _converted(_typed(value, element), current))
    return later


def _typed(value: Any, type_: Any) -> Any:
    """Return a value with each scalar without quotes as what it is in a field of this type."""
    if isinstance(value, list):
        return [_typed(each, type_) for each in value]
    if not isinstance(value, ros_yaml.Plain):
        return value
    if isinstance(type_, AbstractGenericString):
        return str(value)
    if value.isdecimal() and not value.startswith("0"):  # uint64 exceeds the integers of parameters
        return int(value)
    return ros_yaml.typed(value)


def _converted(value: Any, current: Any) -> Any:
    if isinstance(current, array.array):
        return array.array(current.typecode, value)
    if type(current).__name__ == "ndarray":
        import numpy

        return numpy.array(value, dtype=current.dtype)
    return value if type(value) is type(current) else type(current)(value)
