"""The types in ``SLOT_TYPES`` of a message class, as ``rosidl_parser`` describes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosidl_parser.definition import (
    AbstractNestableType,
    AbstractType,
    Array,
    BasicType,
    BoundedSequence,
    BoundedString,
    BoundedWString,
    NamespacedType,
    UnboundedSequence,
    UnboundedString,
    UnboundedWString,
)

if TYPE_CHECKING:
    from .definition import FieldType


def slot_type(type_: FieldType) -> AbstractType:
    element = _element(type_)
    if type_.array_size:
        return Array(element, type_.array_size)
    if type_.sequence_bound:
        return BoundedSequence(element, type_.sequence_bound)
    return UnboundedSequence(element) if type_.is_sequence else element


def _element(type_: FieldType) -> AbstractNestableType:
    if type_.is_message:
        *namespaces, name = type_.base.split("/")
        return NamespacedType(namespaces, name)
    if type_.base == "string":
        return BoundedString(type_.string_bound) if type_.string_bound else UnboundedString()
    if type_.base == "wstring":
        return BoundedWString(type_.string_bound) if type_.string_bound else UnboundedWString()
    return BasicType(type_.base)
