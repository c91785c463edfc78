"""The C functions and structures that the classes of messages keep in capsules."""

from __future__ import annotations

import ctypes as ct
from typing import Any

_capsule_pointer = ct.pythonapi.PyCapsule_GetPointer
_capsule_pointer.restype, _capsule_pointer.argtypes = ct.c_void_p, (ct.py_object, ct.c_char_p)
_capsule_name = ct.pythonapi.PyCapsule_GetName
_capsule_name.restype, _capsule_name.argtypes = ct.c_char_p, (ct.py_object,)


def capsule_address(message: Any, name: str) -> int:
    metaclass = message.__class__
    if metaclass._TYPE_SUPPORT is None:
        metaclass.__import_type_support__()
    capsule = getattr(metaclass, name)
    return int(_capsule_pointer(capsule, _capsule_name(capsule)))
