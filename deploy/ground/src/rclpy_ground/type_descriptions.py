"""Descriptions of types (REP 2016) from their type supports, as messages of type_description_interfaces."""

from __future__ import annotations

import ctypes as ct
from typing import Any

from rclpy_ground.capsules import capsule_address
from rclpy_ground.rcl import POINTER, function

_WORD = ct.sizeof(ct.c_void_p)
_BEFORE_HASH = {"message": 3, "service": 8, "action": 5}
"""The number of pointers in a type support before its functions for hash, description and sources."""
_SIZE_OF_SOURCE = 3 * 3 * _WORD
"""A TypeSource has three strings: pointer, size, capacity [octets]."""
_Function = ct.PYFUNCTYPE(ct.c_void_p, ct.c_void_p)
# The static structures of type supports are not messages yet: their empty strings are null pointers.
_copy_description = function("rcl_convert_type_description_runtime_to_msg", POINTER, POINTER)
_copy_sources = function("rcl_convert_type_source_sequence_runtime_to_msg", POINTER, POINTER)
_MESSAGES = "type_description_interfaces__msg__"
_free_description = function(f"{_MESSAGES}TypeDescription__destroy", None, POINTER)
_free_sources = function(f"{_MESSAGES}TypeSource__Sequence__destroy", None, POINTER)


class TypeSupport:
    """The type support of a message, service or action: what rosidl has generated for it."""

    def __init__(self, type_: Any, kind: str) -> None:
        self._address = capsule_address(type_, "_TYPE_SUPPORT")
        self._functions = self._address + _BEFORE_HASH[kind] * _WORD

    def _call(self, index: int) -> int:
        pointer = ct.c_void_p.from_address(self._functions + index * _WORD).value
        return (pointer and _Function(pointer)(self._address)) or 0

    def hash(self) -> str:
        """Return the hash of the type: RIHS and its version, a number."""
        pointer = self._call(0)
        value = ct.string_at(pointer, 33) if pointer else bytes(33)
        return f"RIHS{value[0]:02}_{value[1:].hex()}"

    def description(self) -> Any:
        from type_description_interfaces.msg import TypeDescription

        copy = _copy_description(self._call(1))
        try:
            return _converted(TypeDescription, copy)
        finally:
            _free_description(copy)

    def sources(self) -> list[Any]:
        from type_description_interfaces.msg import TypeSource

        copy = _copy_sources(self._call(2))  # struct: pointer to the first one, size, capacity
        try:
            first, size = (ct.c_size_t * 2).from_address(copy)
            return [_converted(TypeSource, first + index * _SIZE_OF_SOURCE) for index in range(size)]
        finally:
            _free_sources(copy)


def _converted(message: Any, address: int) -> Any:
    """Return the Python message of a C structure."""
    convert = ct.PYFUNCTYPE(ct.py_object, ct.c_void_p)(capsule_address(message, "_CONVERT_TO_PY"))
    return convert(address)
