"""Messages by their type supports: their names and hashes, and their octets."""

from __future__ import annotations

import ctypes as ct
import threading
from typing import Any

from rclpy_ground.capsules import capsule_address
from rclpy_ground.genuine import RCLError, RMWError, genuine
from rclpy_ground.rcl import ALLOCATOR, LIBRARY, Allocator, reset_error
from rclpy_ground.type_descriptions import TypeSupport

deserialize = genuine.rclpy_deserialize

_known: dict[Any, tuple[str, str]] = {}


def type_of(message: Any) -> tuple[str, str]:
    """Return the DDS name and the hash (REP 2016) of a type: a message, or a part of a service or action."""
    if message not in _known:
        package, kind = message.__module__.split(".")[:2]
        text = TypeSupport(message, "message").hash()
        _known[message] = f"{package}::{kind}::dds_::{message.__name__}_", text
    return _known[message]


class _Buffer(ct.Structure):
    """rcutils_uint8_array_t."""

    _fields_ = [
        ("buffer", ct.c_void_p),
        ("length", ct.c_size_t),
        ("capacity", ct.c_size_t),
        ("allocator", Allocator),
    ]


_FIRST_CAPACITY = 65536
_resize = LIBRARY.rcutils_uint8_array_resize
_resize.restype, _resize.argtypes = ct.c_int, (ct.c_void_p, ct.c_size_t)
_rmw_serialize = LIBRARY.rmw_serialize
_rmw_serialize.restype, _rmw_serialize.argtypes = ct.c_int, (ct.c_void_p, ct.c_void_p, ct.c_void_p)
_converters: dict[Any, tuple[Any, ...]] = {}
_buffer = _Buffer(None, 0, 0, ALLOCATOR)
_to_buffer = ct.byref(_buffer)
_lock = threading.Lock()
"""Of the buffer, which all threads share."""


def _enlarge(capacity: int) -> None:
    """Give the buffer a capacity of zeros [octets]."""
    if _resize(_to_buffer, capacity):
        raise MemoryError(f"no memory for a message of {capacity} octets")
    ct.memset(_buffer.buffer, 0, capacity)


_enlarge(_FIRST_CAPACITY)


def _converter(message_type: Any) -> tuple[Any, ...]:
    from_python = capsule_address(message_type, "_CONVERT_FROM_PY")
    found = (
        ct.PYFUNCTYPE(ct.c_void_p)(capsule_address(message_type, "_CREATE_ROS_MESSAGE")),
        ct.PYFUNCTYPE(ct.c_bool, ct.py_object, ct.c_void_p)(from_python),
        ct.PYFUNCTYPE(None, ct.c_void_p)(capsule_address(message_type, "_DESTROY_ROS_MESSAGE")),
        ct.c_void_p(capsule_address(message_type, "_TYPE_SUPPORT")),
    )
    _converters[message_type] = found
    return found


def rclpy_serialize(message: Any, message_type: Any) -> bytes:
    """Return the CDR of a message, with zeros between its fields.

    The extension's function of this name leaves there what the heap held before, so the same message has
    different octets.
    """
    create, convert, destroy, support = _converters.get(message_type) or _converter(message_type)
    pointer = create()
    try:
        if not convert(message, pointer):  # raises the error of the conversion
            raise RCLError("the message cannot be converted")
        with _lock:
            return _octets(pointer, support)
    finally:
        destroy(pointer)


def _octets(pointer: int, support: Any) -> bytes:
    capacity = _buffer.capacity
    if _rmw_serialize(pointer, support, _to_buffer):
        reset_error()
        raise RMWError("Failed to serialize ROS message")
    if _buffer.capacity != capacity:  # rmw has enlarged it, with octets of the heap: once more, with zeros
        ct.memset(_buffer.buffer, 0, _buffer.capacity)
        _rmw_serialize(pointer, support, _to_buffer)
    address, length = _buffer.buffer, _buffer.length
    data = ct.string_at(address, length)
    if data.endswith(bytes(4)):
        # rmw_fastrtps returns the length that it has estimated, which is too long after an empty sequence of
        # large numbers. Whatever octets the end had before are still there behind the message.
        zeros = length - len(data.rstrip(b"\0"))
        end = address + length - zeros
        ct.memset(end, 0xFF, zeros)
        _rmw_serialize(pointer, support, _to_buffer)
        data = data[: length - zeros + len(ct.string_at(end, zeros).rstrip(b"\xff"))]
    ct.memset(address, 0, length)
    return data
