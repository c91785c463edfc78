"""Converts between ROS QoS profiles and DDS QoS as rmw_cyclonedds_cpp does (facts/discovery.txt)."""

from __future__ import annotations

import ctypes as ct
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache

from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

from rclpy_ground.interface import check, nanoseconds

from . import library
from .library import INFINITY, LENGTH_UNLIMITED, quick

_KEEP_LAST, _KEEP_ALL = 0, 1
_BEST_EFFORT, _RELIABLE = 0, 1
_VOLATILE, _TRANSIENT_LOCAL = 0, 1
_AUTOMATIC, _MANUAL_BY_TOPIC = 0, 2
_XCDR1 = (ct.c_int16 * 1)(0)


@contextmanager
def _with(user_data: str) -> Iterator[int]:
    """Create a DDS QoS with USER_DATA; the end of the ``with`` frees it."""
    qos = quick.dds_create_qos()
    try:
        encoded = user_data.encode()
        quick.dds_qset_userdata(qos, encoded, len(encoded))
        yield qos
    finally:
        quick.dds_delete_qos(qos)


@contextmanager
def endpoint_qos(profile: QoSProfile, user_data: str) -> Iterator[int]:
    """Create the DDS QoS of a reader or writer; the end of the ``with`` frees it.

    ``user_data`` becomes USER_DATA, with which ROS 2 announces type hashes and service identifiers.

    :raises RCLError: if a policy is UNKNOWN, as in rmw.
    """
    check(profile)
    with _with(user_data) as qos:
        quick.dds_qset_writer_data_lifecycle(qos, False)
        quick.dds_qset_data_representation(qos, 1, _XCDR1)
        if profile.history == HistoryPolicy.KEEP_ALL:
            history = (_KEEP_ALL, LENGTH_UNLIMITED)
        else:
            history = (_KEEP_LAST, profile.depth or 1)
        quick.dds_qset_history(qos, *history)
        if profile.reliability == ReliabilityPolicy.BEST_EFFORT:
            quick.dds_qset_reliability(qos, _BEST_EFFORT, 0)
        else:
            quick.dds_qset_reliability(qos, _RELIABLE, INFINITY)
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            quick.dds_qset_durability(qos, _TRANSIENT_LOCAL)
            quick.dds_qset_durability_service(
                qos, 0, *history, LENGTH_UNLIMITED, LENGTH_UNLIMITED, LENGTH_UNLIMITED
            )
        else:
            quick.dds_qset_durability(qos, _VOLATILE)
        quick.dds_qset_lifespan(qos, nanoseconds(profile.lifespan))
        quick.dds_qset_deadline(qos, nanoseconds(profile.deadline))
        manual = profile.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
        lease = nanoseconds(profile.liveliness_lease_duration)
        quick.dds_qset_liveliness(qos, _MANUAL_BY_TOPIC if manual else _AUTOMATIC, lease)
        yield qos


@contextmanager
def participant_qos(user_data: str, properties: Mapping[str, str]) -> Iterator[int]:
    """Create the DDS QoS of a participant; the end of the ``with`` frees it."""
    with _with(user_data) as qos:
        for name, value in properties.items():
            quick.dds_qset_prop(qos, name.encode(), os.fsencode(value))
        yield qos


def user_data(qos: int | None) -> str:
    """Return the USER_DATA of a DDS QoS, '' if there is none."""
    value, size = library.Pointer(), ct.c_size_t()
    if not qos or not quick.dds_qget_userdata(qos, ct.byref(value), ct.byref(size)) or not value:
        return ""
    data = ct.string_at(value, size.value)
    quick.dds_free(value)
    return data.decode(errors="replace")


def profile_of(qos: int | None) -> QoSProfile:
    """Return the ROS profile of a discovered endpoint; history is UNKNOWN if it is not announced.

    Endpoints with equal policies share it: a domain has many endpoints, and few profiles.
    """
    kind, depth, duration = ct.c_int(), ct.c_int32(), library.Duration()

    def duration_of(getter: str) -> int:
        return duration.value if qos and getattr(quick, getter)(qos, ct.byref(duration)) else INFINITY

    reliability, durability = ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE
    liveliness, lease = LivelinessPolicy.AUTOMATIC, INFINITY
    history = HistoryPolicy.UNKNOWN
    if qos and quick.dds_qget_history(qos, ct.byref(kind), ct.byref(depth)):
        history = HistoryPolicy.KEEP_ALL if kind.value == _KEEP_ALL else HistoryPolicy.KEEP_LAST
    if qos and quick.dds_qget_reliability(qos, ct.byref(kind), ct.byref(duration)):
        reliability = ReliabilityPolicy.RELIABLE if kind.value else ReliabilityPolicy.BEST_EFFORT
    if qos and quick.dds_qget_durability(qos, ct.byref(kind)):
        durability = DurabilityPolicy.TRANSIENT_LOCAL if kind.value else DurabilityPolicy.VOLATILE
    if qos and quick.dds_qget_liveliness(qos, ct.byref(kind), ct.byref(duration)):
        manual = kind.value == _MANUAL_BY_TOPIC
        liveliness = LivelinessPolicy.MANUAL_BY_TOPIC if manual else LivelinessPolicy.AUTOMATIC
        lease = duration.value
    lifespan, deadline = duration_of("dds_qget_lifespan"), duration_of("dds_qget_deadline")
    policies = history, max(0, depth.value), reliability, durability, liveliness
    return _profile(*policies, lifespan, deadline, lease)


@lru_cache(maxsize=256)
def _profile(
    history: HistoryPolicy,
    depth: int,
    reliability: ReliabilityPolicy,
    durability: DurabilityPolicy,
    liveliness: LivelinessPolicy,
    lifespan: int,
    deadline: int,
    lease: int,
) -> QoSProfile:
    return QoSProfile(
        history=history,
        depth=depth,
        reliability=reliability,
        durability=durability,
        lifespan=Duration(nanoseconds=lifespan),
        deadline=Duration(nanoseconds=deadline),
        liveliness=liveliness,
        liveliness_lease_duration=Duration(nanoseconds=lease),
    )
