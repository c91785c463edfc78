"""Parameters that ROS arguments and parameter files give to a node, as rcl has parsed them."""

from __future__ import annotations

import ctypes as ct
import re
from typing import Any

from rclpy_ground.genuine import RCLError
from rclpy_ground.rcl import OUT, POINTER, Arguments, function

# rcl_yaml_param_parser/types.h


class _Array(ct.Structure):
    _fields_ = [("values", ct.c_void_p), ("size", ct.c_size_t)]


class _Strings(ct.Structure):
    _fields_ = [("size", ct.c_size_t), ("data", ct.POINTER(ct.c_char_p))]


class _Variant(ct.Structure):
    _fields_ = [
        ("bool", ct.POINTER(ct.c_bool)),
        ("integer", ct.POINTER(ct.c_int64)),
        ("double", ct.POINTER(ct.c_double)),
        ("string", ct.c_char_p),
        ("bytes", ct.POINTER(_Array)),
        ("bools", ct.POINTER(_Array)),
        ("integers", ct.POINTER(_Array)),
        ("doubles", ct.POINTER(_Array)),
        ("strings", ct.POINTER(_Strings)),
    ]

    def typed(self) -> tuple[int, Any]:
        """Return the number of rcl_interfaces/msg/ParameterType, and the value."""
        for number, name in enumerate(("bool", "integer", "double"), 1):
            if pointer := getattr(self, name):
                return number, pointer[0]
        if self.string is not None:
            return 4, self.string.decode()
        if self.bytes:
            return 5, ct.string_at(self.bytes[0].values, self.bytes[0].size)
        kinds = (("bools", ct.c_bool), ("integers", ct.c_int64), ("doubles", ct.c_double))
        for number, (name, kind) in enumerate(kinds, 6):
            if pointer := getattr(self, name):
                array: Any = kind * pointer[0].size
                return number, list(array.from_address(pointer[0].values)) if pointer[0].size else []
        if self.strings:
            strings = self.strings[0]
            return 9, [strings.data[i].decode() for i in range(strings.size)]
        return 0, None


class _NodeParams(ct.Structure):
    _fields_ = [
        ("names", ct.POINTER(ct.c_char_p)),
        ("values", ct.POINTER(_Variant)),
        ("count", ct.c_size_t),
        ("capacity", ct.c_size_t),
    ]


class _Params(ct.Structure):
    _fields_ = [
        ("nodes", ct.POINTER(ct.c_char_p)),
        ("params", ct.POINTER(_NodeParams)),
        ("count", ct.c_size_t),
        ("capacity", ct.c_size_t),
    ]


_overrides = function("rcl_arguments_get_param_overrides", ct.c_int, POINTER, OUT)
_fini = function("rcl_yaml_node_struct_fini", None, POINTER)


def parameters(arguments: Arguments, fqn: str) -> dict[str, tuple[int, Any]]:
    """Return type and value of each parameter that the arguments give to a node of this full name."""
    found: dict[str, tuple[int, Any]] = {}
    out = ct.c_void_p()
    if _overrides(arguments.pointer, ct.byref(out)):
        raise RCLError("failed to get parameter overrides")
    if not out.value:
        return found
    try:
        params = _Params.from_address(out.value)
        for index in range(params.count):
            if _fits(params.nodes[index].decode(), fqn):
                node = params.params[index]
                for number in range(node.count):
                    found[node.names[number].decode()] = node.values[number].typed()
    finally:
        _fini(out)
    return found


def _fits(pattern: str, fqn: str) -> bool:
    """Return whether the name of a section in a parameter file names a node; rcl has made ``*`` a regex."""
    pattern = pattern if pattern.startswith("/") else f"/{pattern}"
    return re.fullmatch(pattern.replace("/*", r"(/\w+)"), fqn) is not None
