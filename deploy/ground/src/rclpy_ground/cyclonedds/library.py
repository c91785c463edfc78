"""The C functions of Eclipse Cyclone DDS that this ground needs, through ctypes.

The PyPI distribution ``cyclonedds`` contains the C library, version 11, without DDS security. Where security
is wanted, another library is loaded (:mod:`.security`), which may be of version 0.10, as in Debian.

The Python layer of Cyclone DDS is not imported: it holds the interpreter lock while it writes, announces
XTypes information that ROS 2 nodes do not announce, and takes 130 ms to import. The C functions below are
Cyclone's interface for applications with messages in CDR, which ``rmw_cyclonedds`` uses, too.

The library is loaded twice. Calls of ``blocking`` release the interpreter lock: for functions that may wait.
Calls of ``quick`` keep it, which costs less: for functions that never block.
"""

from __future__ import annotations

import ctypes as ct
import importlib.util
import os
from pathlib import Path
from struct import Struct
from types import ModuleType
from typing import Any

from rclpy_ground.genuine import RCLError

from . import security

Entity = ct.c_int32
Pointer = ct.c_void_p
Duration = ct.c_int64

INFINITY = 0x7FFFFFFFFFFFFFFF  # DDS_INFINITY [ns]
LENGTH_UNLIMITED = -1
ANY_STATE = 0x7F  # every sample, view and instance state
SERDATA_KIND_DATA = 2
LIBRARY_HANDLE = 0x7FFF0000 + 256  # DDS_CYCLONEDDS_HANDLE, parent of entities without a participant
PRECONDITION_NOT_MET = -4
TIMEOUT = -10

BUILTIN_PARTICIPANTS = 0x7FFF0000 + 1
BUILTIN_PUBLICATIONS = 0x7FFF0000 + 3
BUILTIN_SUBSCRIPTIONS = 0x7FFF0000 + 4


class DDSError(RCLError):  # type: ignore[misc]
    """A call into DDS failed; ``code`` is the DDS return code."""

    def __init__(self, code: int, what: str) -> None:
        reason = quick.dds_strretcode(code)
        super().__init__(f"{what}: {reason.decode() if reason else 'unknown error'} (DDS return code {code})")
        self.code = code


class Serdata(ct.c_void_p):
    """struct ddsi_serdata *: a sample in DDS's memory. As a result, it is not converted to a number."""


class SerdataHeader(ct.Structure):
    """struct ddsi_serdata of version 0.10, as far as it is read."""

    _fields_ = [
        ("ops", Pointer),
        ("hash", ct.c_uint32),
        ("references", ct.c_uint32),
        ("kind", ct.c_int),
        ("type", Pointer),
    ]


class TopicDescriptor(ct.Structure):
    """dds_topic_descriptor_t: the description of a type for DDS."""

    _fields_ = [
        ("size", ct.c_uint32),
        ("align", ct.c_uint32),
        ("flagset", ct.c_uint32),
        ("nkeys", ct.c_uint32),
        ("typename", ct.c_char_p),
        ("keys", Pointer),
        ("nops", ct.c_uint32),
        ("ops", ct.POINTER(ct.c_uint32)),
        ("meta", ct.c_char_p),
        ("type_information", Pointer),
        ("type_information_size", ct.c_uint32),
        ("type_mapping", Pointer),
        ("type_mapping_size", ct.c_uint32),
        ("restrict_data_representation", ct.c_uint32),
    ]


class SampleInfo(ct.Structure):
    """dds_sample_info_t: the metadata of a sample."""

    _fields_ = [
        ("sample_state", ct.c_int),
        ("view_state", ct.c_int),
        ("instance_state", ct.c_int),
        ("valid_data", ct.c_bool),
        ("source_timestamp", ct.c_int64),
        ("instance_handle", ct.c_uint64),
        ("publication_handle", ct.c_uint64),
        ("disposed_generation_count", ct.c_uint32),
        ("no_writers_generation_count", ct.c_uint32),
        ("sample_rank", ct.c_uint32),
        ("generation_rank", ct.c_uint32),
        ("absolute_generation_rank", ct.c_uint32),
    ]


pack_vector = Struct("PN").pack  # struct iovec of address and size, for less than a ctypes structure costs
BYTES_HEADER = bytes.__basicsize__ - 1  # where the octets of a bytes object begin; they end with a NUL


class Guid(ct.Structure):
    """dds_guid_t."""

    _fields_ = [("bytes", ct.c_uint8 * 16)]


class BuiltinParticipant(ct.Structure):
    """dds_builtintopic_participant_t: a discovered participant."""

    _fields_ = [("key", Guid), ("qos", Pointer)]


class BuiltinEndpoint(ct.Structure):
    """dds_builtintopic_endpoint_t: a discovered reader or writer."""

    _fields_ = [
        ("key", Guid),
        ("participant_key", Guid),
        ("participant_instance_handle", ct.c_uint64),
        ("topic_name", ct.c_char_p),
        ("type_name", ct.c_char_p),
        ("qos", Pointer),
    ]


class NetworkAddress(ct.Structure):
    """struct ifaddrs: an address of a network interface."""


NetworkAddress._fields_ = [
    ("next", ct.POINTER(NetworkAddress)),
    ("name", ct.c_char_p),
    ("flags", ct.c_uint),
    ("family", ct.POINTER(ct.c_ushort)),  # the address begins with it
]


def _path() -> str:
    if security.is_wanted(os.environ) and (found := security.library(os.environ)):
        return str(found)  # without one, the first context reports it
    spec = importlib.util.find_spec("cyclonedds")
    if spec is None or not spec.submodule_search_locations:
        raise ImportError("Eclipse Cyclone DDS is not installed: pip install 'cyclonedds>=11.0.1,<12'")
    package = Path(spec.submodule_search_locations[0])
    libraries = package.parent / "cyclonedds.libs"
    for path in sorted(libraries.glob("libddsc*")):
        return str(path)
    raise ImportError(f"the C library of Cyclone DDS is missing: no libddsc* in {libraries}")


# Every message passes through these. So that ctypes need not check and convert the arguments, callers pass
# only bytes and ctypes objects of the types below, never an `int`: ctypes would cut it to 32 bits.
_CALLED_WITH_CONVERTED = {
    "dds_waitset_wait",
    "dds_takecdr",
    "ddsi_serdata_size",
    "ddsi_serdata_to_ser",
    "ddsi_serdata_unref",
    "ddsi_serdata_from_ser_iov",
    "dds_writecdr",
}

# name: (result, arguments). These may wait, or take a lock that another thread holds for long.
_BLOCKING: dict[str, tuple[Any, list[Any]]] = {
    "dds_create_domain": (Entity, [ct.c_uint32, ct.c_char_p]),
    "dds_create_participant": (Entity, [ct.c_uint32, Pointer, Pointer]),
    "dds_create_publisher": (Entity, [Entity, Pointer, Pointer]),
    "dds_create_subscriber": (Entity, [Entity, Pointer, Pointer]),
    "dds_create_topic": (Entity, [Entity, ct.POINTER(TopicDescriptor), ct.c_char_p, Pointer, Pointer]),
    "dds_create_reader": (Entity, [Entity, Entity, Pointer, Pointer]),
    "dds_create_writer": (Entity, [Entity, Entity, Pointer, Pointer]),
    "dds_create_readcondition": (Entity, [Entity, ct.c_uint32]),
    "dds_create_guardcondition": (Entity, [Entity]),
    "dds_create_waitset": (Entity, [Entity]),
    "dds_delete": (ct.c_int32, [Entity]),
    "dds_waitset_attach": (ct.c_int32, [Entity, Entity, ct.c_ssize_t]),
    "dds_waitset_detach": (ct.c_int32, [Entity, Entity]),
    "dds_waitset_wait": (ct.c_int32, [Entity, Pointer, ct.c_size_t, Duration]),
    "dds_set_guardcondition": (ct.c_int32, [Entity, ct.c_bool]),
    "dds_take_guardcondition": (ct.c_int32, [Entity, ct.POINTER(ct.c_bool)]),
    "dds_writecdr": (ct.c_int32, [Entity, Serdata]),
    "dds_write": (ct.c_int32, [Entity, Pointer]),
    "dds_wait_for_acks": (ct.c_int32, [Entity, Duration]),
    "dds_assert_liveliness": (ct.c_int32, [Entity]),
    "dds_get_status_mask": (ct.c_int32, [Entity, ct.POINTER(ct.c_uint32)]),
    "dds_set_status_mask": (ct.c_int32, [Entity, ct.c_uint32]),
    "dds_get_status_changes": (ct.c_int32, [Entity, ct.POINTER(ct.c_uint32)]),
    "dds_read_mask": (ct.c_int32, [Entity, Pointer, Pointer, ct.c_size_t, ct.c_uint32, ct.c_uint32]),
    "dds_take_mask": (ct.c_int32, [Entity, Pointer, Pointer, ct.c_size_t, ct.c_uint32, ct.c_uint32]),
    "dds_triggered": (ct.c_int32, [Entity]),
    "dds_return_loan": (ct.c_int32, [Entity, Pointer, ct.c_int32]),
}

_QUICK: dict[str, tuple[Any, list[Any]]] = {
    "dds_strretcode": (ct.c_char_p, [ct.c_int32]),
    "dds_takecdr": (ct.c_int32, [Entity, Pointer, ct.c_uint32, Pointer, ct.c_uint32]),
    "dds_writecdr": (ct.c_int32, [Entity, Serdata]),
    "ddsi_serdata_size": (ct.c_uint32, [Serdata]),
    "ddsi_serdata_to_ser": (None, [Serdata, ct.c_size_t, ct.c_size_t, Pointer]),
    "ddsi_serdata_unref": (None, [Serdata]),
    "ddsi_serdata_from_ser_iov": (
        Serdata,
        [Pointer, ct.c_int, ct.c_size_t, Pointer, ct.c_size_t],
    ),
    "dds_get_guid": (ct.c_int32, [Entity, ct.POINTER(Guid)]),
    "dds_get_instance_handle": (ct.c_int32, [Entity, ct.POINTER(ct.c_uint64)]),
    "dds_get_matched_publications": (ct.c_int32, [Entity, Pointer, ct.c_size_t]),
    "dds_get_matched_subscriptions": (ct.c_int32, [Entity, Pointer, ct.c_size_t]),
    "dds_get_matched_publication_data": (ct.POINTER(BuiltinEndpoint), [Entity, ct.c_uint64]),
    "dds_get_matched_subscription_data": (ct.POINTER(BuiltinEndpoint), [Entity, ct.c_uint64]),
    "dds_builtintopic_free_endpoint": (None, [ct.POINTER(BuiltinEndpoint)]),
    "dds_free": (None, [Pointer]),
    "dds_create_qos": (Pointer, []),
    "dds_delete_qos": (None, [Pointer]),
    "dds_qset_prop": (None, [Pointer, ct.c_char_p, ct.c_char_p]),
    "dds_qset_userdata": (None, [Pointer, ct.c_char_p, ct.c_size_t]),
    "dds_qset_durability": (None, [Pointer, ct.c_int]),
    "dds_qset_durability_service": (
        None,
        [Pointer, Duration, ct.c_int, ct.c_int32, ct.c_int32, ct.c_int32, ct.c_int32],
    ),
    "dds_qset_history": (None, [Pointer, ct.c_int, ct.c_int32]),
    "dds_qset_reliability": (None, [Pointer, ct.c_int, Duration]),
    "dds_qset_lifespan": (None, [Pointer, Duration]),
    "dds_qset_deadline": (None, [Pointer, Duration]),
    "dds_qset_liveliness": (None, [Pointer, ct.c_int, Duration]),
    "dds_qset_writer_data_lifecycle": (None, [Pointer, ct.c_bool]),
    "dds_qset_data_representation": (None, [Pointer, ct.c_uint32, ct.POINTER(ct.c_int16)]),
    "dds_qget_userdata": (ct.c_bool, [Pointer, ct.POINTER(Pointer), ct.POINTER(ct.c_size_t)]),
    "dds_qget_durability": (ct.c_bool, [Pointer, ct.POINTER(ct.c_int)]),
    "dds_qget_history": (ct.c_bool, [Pointer, ct.POINTER(ct.c_int), ct.POINTER(ct.c_int32)]),
    "dds_qget_reliability": (ct.c_bool, [Pointer, ct.POINTER(ct.c_int), ct.POINTER(Duration)]),
    "dds_qget_lifespan": (ct.c_bool, [Pointer, ct.POINTER(Duration)]),
    "dds_qget_deadline": (ct.c_bool, [Pointer, ct.POINTER(Duration)]),
    "dds_qget_liveliness": (ct.c_bool, [Pointer, ct.POINTER(ct.c_int), ct.POINTER(Duration)]),
}


def functions(library: ct.CDLL, signatures: dict[str, tuple[Any, list[Any]]]) -> Any:
    """Return a namespace of C functions, with declared results, and arguments where ctypes must convert them.

    It is a module: the interpreter finds an attribute of one without a look-up.
    """
    declared = ModuleType("functions of C")
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        if name not in _CALLED_WITH_CONVERTED:
            function.argtypes = arguments
        setattr(declared, name, function)
    return declared


_LIBC: dict[str, tuple[Any, list[Any]]] = {
    "getifaddrs": (ct.c_int, [ct.POINTER(ct.POINTER(NetworkAddress))]),
    "freeifaddrs": (None, [ct.POINTER(NetworkAddress)]),
}

LOCK_KEEPING = ct.PyDLL(_path())
IS_RECENT = hasattr(LOCK_KEEPING, "dds_get_entity_sertype")
"""Whether the library is of version 11, not 0.10."""
if IS_RECENT:
    _QUICK["dds_get_entity_sertype"] = ct.c_int32, [Entity, ct.POINTER(Pointer)]
blocking = functions(ct.CDLL(_path()), _BLOCKING)
quick = functions(LOCK_KEEPING, _QUICK)
libc = functions(ct.CDLL(None), _LIBC)


def checked(code: int, what: str) -> int:
    """Return ``code``. Raises DDSError with ``what`` if it is negative."""
    if code < 0:
        raise DDSError(code, what)
    return code
