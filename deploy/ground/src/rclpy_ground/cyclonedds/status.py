"""Communication statuses of readers and writers: deadlines, liveliness, matching, QoS and lost samples."""

from __future__ import annotations

import ctypes as ct
from typing import Any

from .library import LOCK_KEEPING, Entity, blocking, functions

_HANDLE = ("last_instance_handle", ct.c_uint64)
_COUNTS = [("total_count", ct.c_uint32), ("total_count_change", ct.c_int32)]
_CURRENT = [("current_count", ct.c_uint32), ("current_count_change", ct.c_int32)]


def _structure(name: str, fields: list[tuple[str, Any]]) -> type[ct.Structure]:
    return type(name, (ct.Structure,), {"_fields_": fields})


# Name in the getter -> bit of the DDS status mask, and the C structure.
STATUSES: dict[str, tuple[int, type[ct.Structure]]] = {
    "offered_deadline_missed": (1 << 1, _structure("OfferedDeadlineMissed", [*_COUNTS, _HANDLE])),
    "requested_deadline_missed": (1 << 2, _structure("RequestedDeadlineMissed", [*_COUNTS, _HANDLE])),
    "offered_incompatible_qos": (
        1 << 3,
        _structure("OfferedIncompatibleQos", [*_COUNTS, ("last_policy_id", ct.c_uint32)]),
    ),
    "requested_incompatible_qos": (
        1 << 4,
        _structure("RequestedIncompatibleQos", [*_COUNTS, ("last_policy_id", ct.c_uint32)]),
    ),
    "sample_lost": (1 << 5, _structure("SampleLost", _COUNTS)),
    "liveliness_lost": (1 << 9, _structure("LivelinessLost", _COUNTS)),
    "liveliness_changed": (
        1 << 10,
        _structure(
            "LivelinessChanged",
            [
                ("alive_count", ct.c_uint32),
                ("not_alive_count", ct.c_uint32),
                ("alive_count_change", ct.c_int32),
                ("not_alive_count_change", ct.c_int32),
                _HANDLE,
            ],
        ),
    ),
    "publication_matched": (1 << 11, _structure("PublicationMatched", [*_COUNTS, *_CURRENT, _HANDLE])),
    "subscription_matched": (1 << 12, _structure("SubscriptionMatched", [*_COUNTS, *_CURRENT, _HANDLE])),
}

_getters = functions(
    LOCK_KEEPING,
    {
        f"dds_get_{name}_status": (ct.c_int32, [Entity, ct.POINTER(structure)])
        for name, (_, structure) in STATUSES.items()
    },
)


def watch(handle: int, names: list[str]) -> None:
    """Make changes of the named statuses trigger the wait sets to which the entity is attached."""
    mask = 0
    for name in names:
        mask |= STATUSES[name][0]
    blocking.dds_set_status_mask(handle, mask)


def watch_also(handle: int, name: str) -> None:
    mask = ct.c_uint32()
    blocking.dds_get_status_mask(handle, ct.byref(mask))
    blocking.dds_set_status_mask(handle, mask.value | STATUSES[name][0])


def changed(handle: int, name: str) -> dict[str, int] | None:
    """Return the fields of a status if it has changed since the last call, else ``None``."""
    bit, structure = STATUSES[name]
    changes = ct.c_uint32()
    if blocking.dds_get_status_changes(handle, ct.byref(changes)) != 0 or not changes.value & bit:
        return None
    status = structure()
    if getattr(_getters, f"dds_get_{name}_status")(handle, ct.byref(status)) != 0:
        return None
    return {field[0]: getattr(status, field[0]) for field in structure._fields_}
