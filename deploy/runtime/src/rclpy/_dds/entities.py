"""DDS entities as Python objects: thin, explicit about their end, and quick where messages pass."""

from __future__ import annotations

import ctypes as ct
import time
from typing import Any, NamedTuple

from rclpy._handle import Handle
from rclpy.exceptions import InvalidHandle, RCLError
from rclpy.qos import QoSProfile

from . import domain, qos
from .library import (
    ANY_STATE,
    LIBRARY_HANDLE,
    SERDATA_KIND_DATA,
    TIMEOUT,
    Duration,
    Entity,
    Guid,
    IoVector,
    Pointer,
    SampleInfo,
    TopicDescriptor,
    blocking,
    checked,
    quick,
)

# DDS sees every ROS type as "at least one octet, final, XCDR1": what the octets mean is the codec's business.
# This way a malformed sample reaches the codec, which can say whose it is, and discovery announces no XTypes
# information, as ROS 2's own does not. DDS_OP_ADR | DDS_OP_TYPE_1BY at offset 0, then DDS_OP_RTS.
_OPAQUE = (ct.c_uint32 * 3)(0x01010000, 0, 0)


class Sample(NamedTuple):
    """A received message: CDR with its encapsulation header, time of writing [ns since 1970], its writer."""

    data: bytes
    source_timestamp: int
    publication_handle: int

    def info(self) -> dict[str, Any]:
        """What a callback with two arguments hears of it, as rclpy has it. The numbers DDS does not tell."""
        return {
            "source_timestamp": self.source_timestamp,
            "received_timestamp": time.time_ns(),
            "publication_sequence_number": None,
            "reception_sequence_number": None,
        }


def _matched_handles(handle: int, getter: str) -> list[int]:
    count = getattr(quick, getter)(handle, None, 0)
    handles = (ct.c_uint64 * max(0, count))()
    count = getattr(quick, getter)(handle, handles, len(handles))
    return list(handles[: max(0, min(count, len(handles)))])


def _user_data(handle: int, getter: str, other: int) -> str | None:
    found = getattr(quick, getter)(handle, other)
    if not found:
        return None
    try:
        return qos.user_data(found.contents.qos)
    finally:
        quick.dds_builtintopic_free_endpoint(found)


def _guid(handle: int) -> bytes:
    guid = Guid()
    checked(quick.dds_get_guid(handle, ct.byref(guid)), "cannot read a GUID")
    return bytes(guid.bytes)


class Participant:
    """This process' membership in a DDS domain."""

    def __init__(self, domain_id: int, user_data: str) -> None:
        self.domain_id = domain_id
        domain.enter(domain_id)
        try:
            with qos.participant_qos(user_data) as participant_qos:
                what = f"cannot join DDS domain {domain_id}"
                self.handle = checked(blocking.dds_create_participant(domain_id, participant_qos, None), what)
        except Exception:
            domain.leave(domain_id)
            raise
        self.gid = _guid(self.handle)
        self.publisher = checked(blocking.dds_create_publisher(self.handle, None, None), "publisher")
        self.subscriber = checked(blocking.dds_create_subscriber(self.handle, None, None), "subscriber")

    def close(self) -> None:
        """Leave the domain. Peers are told, so they need not wait for a lease to run out."""
        blocking.dds_delete(self.handle)
        domain.leave(self.domain_id)

    def _topic(self, name: str, type_name: str) -> int:
        descriptor = TopicDescriptor(size=1, align=1, typename=type_name.encode(), nops=2, ops=_OPAQUE)
        handle = blocking.dds_create_topic(self.handle, ct.byref(descriptor), name.encode(), None, None)
        return checked(handle, f"cannot create topic {name} of type {type_name}")

    def create_writer(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Writer:
        """A writer on the DDS topic ``topic`` (mangled: ``rt/...``) of DDS type ``type_name``."""
        handle = self._topic(topic, type_name)
        try:
            with qos.endpoint_qos(profile, user_data) as writer_qos:
                writer = blocking.dds_create_writer(self.publisher, handle, writer_qos, None)
            return Writer(checked(writer, f"cannot create a writer on {topic}"))
        finally:
            blocking.dds_delete(handle)

    def create_reader(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Reader:
        """A reader on the DDS topic ``topic`` (mangled: ``rt/...``) of DDS type ``type_name``."""
        handle = self._topic(topic, type_name)
        try:
            with qos.endpoint_qos(profile, user_data) as reader_qos:
                reader = blocking.dds_create_reader(self.subscriber, handle, reader_qos, None)
            return Reader(checked(reader, f"cannot create a reader on {topic}"))
        finally:
            blocking.dds_delete(handle)


class Writer(Handle):
    """A DDS writer of CDR."""

    def __init__(self, handle: int) -> None:
        self.handle = handle
        self.logger_name = ""  # of the node that it belongs to
        self.gid = _guid(handle)
        sertype = Pointer()
        checked(quick.dds_get_entity_sertype(handle, ct.byref(sertype)), "cannot read a writer's type")
        self._sertype = sertype.value  # None after the end: it is gone with the writer
        instance = ct.c_uint64()
        checked(quick.dds_get_instance_handle(handle, ct.byref(instance)), "cannot read a writer's handle")
        self.instance_handle = instance.value

    def write(self, data: bytes) -> None:
        """
        Send CDR with its encapsulation header. May block where reliability asks for it.

        :raises InvalidHandle: if another thread ends the writer meanwhile.
        """
        if len(data) & 3:  # RTPS pads to four octets; Cyclone would with whatever stands in its memory
            data += bytes(-len(data) & 3)
        size = len(data)
        vector = IoVector(data, size)
        sertype = self._sertype  # from here to the end of the call the interpreter lets no other thread in
        if sertype is None:
            raise InvalidHandle("cannot use a writer that was destroyed")
        serdata = quick.ddsi_serdata_from_ser_iov(sertype, SERDATA_KIND_DATA, 1, vector, size)
        if not serdata:
            raise ValueError(f"DDS refuses these {size} octets: an encapsulation header and data are needed")
        result = blocking.dds_writecdr(self.handle, serdata)
        if result:
            if self._sertype is None:
                raise InvalidHandle("cannot use a writer that was destroyed")
            checked(result, "cannot write")

    def matched(self) -> int:
        """How many readers are matched now."""
        return max(0, int(quick.dds_get_matched_subscriptions(self.handle, None, 0)))

    def matched_user_data(self) -> list[str]:
        """The USER_DATA of every matched reader."""
        handles = _matched_handles(self.handle, "dds_get_matched_subscriptions")
        found = (_user_data(self.handle, "dds_get_matched_subscription_data", other) for other in handles)
        return [data for data in found if data is not None]

    def wait_for_acks(self, timeout: int) -> bool:
        """Whether all matched reliable readers have acknowledged everything within ``timeout`` [ns]."""
        result = blocking.dds_wait_for_acks(self.handle, timeout)
        return result != TIMEOUT and checked(result, "cannot wait for acknowledgements") == 0

    def assert_liveliness(self) -> None:
        """Say that the application behind this writer lives (liveliness MANUAL_BY_TOPIC)."""
        checked(blocking.dds_assert_liveliness(self.handle), "cannot assert liveliness")

    def close(self) -> None:
        """End the writer; what reliable readers still miss is lost."""
        self._sertype = None
        blocking.dds_delete(self.handle)


class Reader(Handle):
    """A DDS reader of CDR. ``condition`` is what a wait set waits on."""

    def __init__(self, handle: int) -> None:
        self.handle = handle
        self.logger_name = ""  # of the node that it belongs to
        self.gid = _guid(handle)
        self.condition = checked(blocking.dds_create_readcondition(handle, ANY_STATE), "read condition")
        # Where DDS puts what is taken: one for each thread that takes, made once, as that costs some time.
        self._rooms: list[tuple[Pointer, int, SampleInfo, int]] = []

    def take(self) -> Sample | None:
        """The next message, None if there is none. On any thread, whoever else takes."""
        try:
            room = self._rooms.pop()
        except IndexError:
            serdata, info = Pointer(), SampleInfo()
            room = serdata, ct.addressof(serdata), info, ct.addressof(info)
        serdata, serdata_address, info, info_address = room
        sample = None
        while quick.dds_takecdr(self.handle, serdata_address, 1, info_address, ANY_STATE) > 0:
            if info.valid_data:
                size = quick.ddsi_serdata_size(serdata)
                data = bytes(size)  # which nobody else knows yet: it may still be written to
                quick.ddsi_serdata_to_ser(serdata, 0, size, data)
                sample = Sample(data, info.source_timestamp, info.publication_handle)
            quick.ddsi_serdata_unref(serdata)
            if sample is not None:  # else a writer came or went: news, but no message
                break
        self._rooms.append(room)
        return sample

    def take_message(self, msg_type: Any, raw: bool) -> tuple[Any, dict[str, Any]] | None:
        """
        The next message and what is known of it, None if there is none: for code that polls its subscription.

        :param raw: whether it is to stay serialized.
        :raises RCLError: if it is no message of ``msg_type``.
        """
        sample = self.take()
        if sample is None:
            return None
        try:
            message = sample.data if raw else msg_type._deserialize(sample.data)
        except ValueError as error:
            raise RCLError(f"failed to take message: {error}") from error
        return message, sample.info()

    def matched(self) -> int:
        """How many writers are matched now."""
        return max(0, int(quick.dds_get_matched_publications(self.handle, None, 0)))

    def matched_user_data(self) -> list[str]:
        """The USER_DATA of every matched writer."""
        handles = _matched_handles(self.handle, "dds_get_matched_publications")
        return [data for other in handles if (data := self.user_data_of(other)) is not None]

    def user_data_of(self, publication_handle: int) -> str | None:
        """The USER_DATA of a matched writer, ``None`` if it is not matched any more."""
        return _user_data(self.handle, "dds_get_matched_publication_data", publication_handle)

    def close(self) -> None:
        """End the reader and its condition."""
        blocking.dds_delete(self.handle)


class GuardCondition:
    """Something an application can trigger to end a wait, from any thread."""

    def __init__(self) -> None:
        self.handle = checked(blocking.dds_create_guardcondition(LIBRARY_HANDLE), "guard condition")

    def trigger(self) -> None:
        """Wake whoever waits."""
        blocking.dds_set_guardcondition(self.handle, True)

    def take(self) -> None:
        """Reset it; a trigger from now on ends the next wait."""
        blocking.dds_take_guardcondition(self.handle, ct.byref(ct.c_bool()))

    def close(self) -> None:
        """End it."""
        blocking.dds_delete(self.handle)


class WaitSet:
    """Waits for any of the attached conditions or entities, with the interpreter lock released."""

    def __init__(self) -> None:
        self.handle = checked(blocking.dds_create_waitset(LIBRARY_HANDLE), "cannot create a wait set")
        self._attached = 0
        self._make_room(0)
        self.closed = False

    def _make_room(self, capacity: int) -> None:
        self._capacity = capacity
        tokens, timeout = (ct.c_ssize_t * capacity)(), Duration()
        # Made once: a wait comes after each callback, and to convert them each time costs more than the call.
        address = Pointer(ct.addressof(tokens))
        self._room = tokens, timeout, (Entity(self.handle), address, ct.c_size_t(capacity), timeout)

    def attach(self, handle: int, token: int) -> bool:
        """Wait on ``handle`` from now on; ``wait`` reports it as ``token``. False if it is gone already."""
        if blocking.dds_waitset_attach(self.handle, handle, token) != 0:
            return False
        self._attached += 1
        if self._attached > self._capacity:
            self._make_room(2 * self._attached + 8)
        return True

    def detach(self, handle: int) -> None:
        """Wait on ``handle`` no longer. One that was deleted has left by itself."""
        blocking.dds_waitset_detach(self.handle, handle)
        self._attached -= 1

    def wait(self, timeout: int) -> list[int]:
        """The tokens of what is triggered, after at most ``timeout`` [ns]; empty if nothing was."""
        # Held here: DDS writes into the tokens, while another thread may attach more and make new room.
        tokens, duration, arguments = self._room
        duration.value = timeout
        count = blocking.dds_waitset_wait(*arguments)
        if not count or self.closed:
            return []
        return tokens[: min(checked(count, "cannot wait"), len(tokens))]

    def close(self) -> None:
        """End it, and every wait; what was attached lives on."""
        self.closed = True
        blocking.dds_delete(self.handle)
