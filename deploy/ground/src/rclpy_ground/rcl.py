"""Public functions of rcl, by ctypes: the extension of rclpy has loaded them, for its own nodes."""

from __future__ import annotations

import ctypes as ct
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rclpy_ground.genuine import PATH, RCLError, genuine

LIBRARY = ct.PyDLL(str(PATH))
"""The extension and, with it, all libraries that it is linked with. Calls are short and keep the GIL."""
_SECURITY = "ROS_SECURITY_ENABLE"
POINTER, TEXT = ct.c_void_p, ct.c_char_p
OUT = ct.POINTER(ct.c_void_p)


class Allocator(ct.Structure):
    """rcutils_allocator_t."""

    _fields_ = [(name, ct.c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero", "state")]


def function(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """Return a function of the library with its types."""
    found = getattr(LIBRARY, name)
    found.restype, found.argtypes = result, arguments
    return found  # type: ignore[no-any-return]


reset_error = function("rcutils_reset_error", None)
ALLOCATOR: Allocator = function("rcutils_get_default_allocator", Allocator)()
_free = ct.PYFUNCTYPE(None, ct.c_void_p, ct.c_void_p)(ALLOCATOR.deallocate)
_NAME = (POINTER, POINTER, TEXT, TEXT, TEXT, Allocator, OUT)
_remap_topic = function("rcl_remap_topic_name", ct.c_int, *_NAME)
_remap_service = function("rcl_remap_service_name", ct.c_int, *_NAME)
_remap_node = function("rcl_remap_node_name", ct.c_int, POINTER, POINTER, TEXT, Allocator, OUT)
_remap_namespace = function("rcl_remap_node_namespace", ct.c_int, POINTER, POINTER, TEXT, Allocator, OUT)


def _text(call: Callable[..., int], *arguments: Any) -> str | None:
    out = ct.c_void_p()
    if call(*arguments, ALLOCATOR, ct.byref(out)):
        reset_error()
        raise RCLError("failed to remap a name")
    if not out.value:
        return None
    text = ct.string_at(out.value).decode()
    _free(out.value, ALLOCATOR.state)
    return text


@contextmanager
def _without_security() -> Iterator[None]:
    """Keep rcl from looking for keys: it reports where it finds them, and only a ground uses them."""
    wanted = os.environ.pop(_SECURITY, None)
    try:
        yield
    finally:
        if wanted is not None:
            os.environ[_SECURITY] = wanted


class Arguments:
    """The ROS arguments of a process or a node, as rcl parses them. Raises for wrong ones."""

    def __init__(self, argv: list[str], domain_id: int = 0) -> None:
        with _without_security():
            self.context = genuine.Context(argv, domain_id)  # without a node, it joins no domain
        self.pointer = self.context.pointer  # rcl_context_t begins with its rcl_arguments_t


def remap_node(own: Arguments, process: Arguments | None, name: str, namespace: str) -> tuple[str, str]:
    """Return the name and the namespace of a node after its remapping rules and those of its process."""
    places = own.pointer, process and process.pointer
    name = _text(_remap_node, *places, name.encode()) or name
    return name, _text(_remap_namespace, *places, name.encode()) or namespace


def remap(
    own: Arguments, process: Arguments | None, fqn: str, name: str, namespace: str, *, is_service: bool
) -> str:
    """Return the name of a topic or service of the node ``name`` after its remapping rules."""
    call = _remap_service if is_service else _remap_topic
    places = own.pointer, process and process.pointer
    return _text(call, *places, fqn.encode(), name.encode(), namespace.encode()) or fqn
