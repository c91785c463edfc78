"""Converts messages to YAML, CSV and dictionaries."""

from __future__ import annotations

import array
import sys
from collections import OrderedDict
from collections.abc import Iterable
from itertools import dropwhile
from typing import Any

from rosidl_parser.definition import (
    AbstractNestedType,
    AbstractString,
    AbstractType,
    AbstractWString,
    Array,
    BasicType,
    BoundedSequence,
    NamespacedType,
)


def message_to_yaml(
    msg: Any,
    *,
    truncate_length: int | None = None,
    no_arr: bool = False,
    no_str: bool = False,
    flow_style: bool = False,
) -> str:
    """Convert a message to YAML.

    :param truncate_length: length at which strings and arrays are cut; ``None``: they are not.
    :param no_arr: whether type and length replace the elements of arrays.
    :param no_str: whether the length replaces the text of strings.
    :param flow_style: whether arrays are written in one line.
    """
    import yaml

    class Dumper(yaml.Dumper):
        """Writes ordered dictionaries as plain mappings."""

    def mapping(dumper: Dumper, data: OrderedDict[str, Any]) -> yaml.Node:
        return dumper.represent_mapping("tag:yaml.org,2002:map", data.items(), flow_style=False)

    Dumper.add_representer(OrderedDict, mapping)
    fields = message_to_ordereddict(msg, truncate_length=truncate_length, no_arr=no_arr, no_str=no_str)
    text: str = yaml.dump(
        fields, Dumper=Dumper, allow_unicode=True, width=sys.maxsize, default_flow_style=flow_style
    )
    return text


def message_to_csv(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> str:
    """Convert a message to values separated by commas; the options are those of `message_to_yaml`."""

    def text(value: Any, type_: AbstractType | None = None) -> str:
        if _is_array(value):
            if no_arr and isinstance(type_, AbstractNestedType):
                return _summary(value, type_)
            shown = value if truncate_length is None else value[:truncate_length]
            return _joined([*map(text, shown), *(["..."] if len(shown) < len(value) else [])])
        if hasattr(value, "SLOT_TYPES"):
            return message_to_csv(value, truncate_length=truncate_length, no_arr=no_arr, no_str=no_str)
        if isinstance(value, str) and no_str:
            return f"<string length: <{len(value)}>>"
        if isinstance(value, (bytes, str)) and truncate_length is not None and len(value) > truncate_length:
            dots: Any = b"..." if isinstance(value, bytes) else "..."
            return str(value[:truncate_length] + dots)
        return str(value)

    return _joined(text(getattr(msg, name), type_) for name, type_ in get_message_slot_types(msg).items())


def _joined(texts: Iterable[str]) -> str:
    """The texts separated by commas; as in ROS 2, empty ones at the beginning vanish."""
    return ",".join(dropwhile(lambda text: not text, texts))


def message_to_ordereddict(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> OrderedDict[str, Any]:
    """Convert a message to a dictionary in the order of its fields; options as in `message_to_yaml`."""

    def convert(value: Any, type_: AbstractType | None = None) -> Any:
        if isinstance(value, bytes):
            return shortened(value.decode("latin-1"))
        if isinstance(value, str):
            return f"<string length: <{len(value)}>>" if no_str else shortened(value)
        if _is_array(value):
            if no_arr and isinstance(type_, AbstractNestedType):
                return _summary(value, type_)
            shown = value if truncate_length is None else value[:truncate_length]
            # tolist() also turns numpy's numbers into Python's
            elements = [convert(element) for element in (shown if _is_plain(shown) else shown.tolist())]
            elements += ["..."] if len(shown) < len(value) else []
            return tuple(elements) if isinstance(value, tuple) else elements
        if hasattr(value, "SLOT_TYPES"):
            return message_to_ordereddict(
                value, truncate_length=truncate_length, no_arr=no_arr, no_str=no_str
            )
        return value

    def shortened(text: str) -> str:
        cut = truncate_length is not None and len(text) > truncate_length
        return text[:truncate_length] + "..." if cut else text

    types = get_message_slot_types(msg)
    return OrderedDict((name, convert(getattr(msg, name), type_)) for name, type_ in types.items())


def get_message_slot_types(msg: Any) -> OrderedDict[str, AbstractType]:
    """Return the types of a message's fields by their names, in order."""
    return OrderedDict(zip(msg.get_fields_and_field_types(), msg.SLOT_TYPES, strict=True))


def _is_plain(value: Any) -> bool:
    return isinstance(value, (list, tuple))


def _is_array(value: Any) -> bool:
    """Whether it is a sequence; numpy is recognized without importing it."""
    return _is_plain(value) or isinstance(value, array.array) or type(value).__name__ == "ndarray"


def _summary(value: Any, type_: AbstractNestedType) -> str:
    name = _type_name(type_.value_type)
    if isinstance(type_, Array):
        return f"<array type: {name}[{type_.size}]>"
    bound = f"[{type_.maximum_size}]" if isinstance(type_, BoundedSequence) else ""
    return f"<sequence type: {name}{bound}, length: {len(value)}>"


def _type_name(type_: AbstractType) -> str:
    if isinstance(type_, BasicType):
        return type_.typename
    if isinstance(type_, NamespacedType):
        return "/".join(type_.namespaced_name())
    if isinstance(type_, AbstractString):
        return "string"
    return "wstring" if isinstance(type_, AbstractWString) else "unknown"
