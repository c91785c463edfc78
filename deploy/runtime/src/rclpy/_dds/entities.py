"""DDS entities as thin Python objects: explicitly closed, and optimized on the path of messages."""

from __future__ import annotations

import ctypes as ct
import os
import time
from array import array
from contextlib import nullcontext
from functools import cache
from sys import is_finalizing
from typing import Any, NamedTuple

from rclpy._handle import Handle
from rclpy.exceptions import InvalidHandle, RCLError
from rclpy.qos import QoSProfile
from rosidl_runtime_embedded.pieces import LARGE, Pieces

from . import domain, log, qos, security, status
from .discovery import Discovery
from .library import (
    ANY_STATE,
    BYTES_HEADER,
    IS_RECENT,
    LIBRARY_HANDLE,
    SERDATA_KIND_DATA,
    TIMEOUT,
    Duration,
    Entity,
    Guid,
    Pointer,
    SampleInfo,
    Serdata,
    SerdataHeader,
    TopicDescriptor,
    blocking,
    checked,
    pack_vector,
    quick,
)

# To DDS, every ROS type is "at least one octet, final, XCDR1"; the codec interprets the octets. So a
# malformed sample reaches the codec, which can name its writer. And discovery announces no XTypes
# information, as in ROS 2. The operations are DDS_OP_ADR | DDS_OP_TYPE_1BY at offset 0, then DDS_OP_RTS.
_OPAQUE = (ct.c_uint32 * 3)(0x01010000, 0, 0)


# Arguments of C functions that are the same for every message. ctypes would convert a number each time, for
# more than most of these calls cost.
_DATA = ct.c_int.from_param(SERDATA_KIND_DATA)
_ANY = ct.c_uint32.from_param(ANY_STATE)
_ONE_SAMPLE = ct.c_uint32.from_param(1)
_ONE_PIECE = ct.c_size_t.from_param(1)
_BEGINNING = ct.c_size_t.from_param(0)


class Sample(NamedTuple):
    """A received message: CDR with encapsulation header, source time [ns since 1970], and its writer.

    The CDR is bytes, or a memoryview if it is lent. Nothing may write to that: other readers of this process
    have the same memory.
    """

    data: Any
    source_timestamp: int
    publication_handle: int

    def info(self) -> dict[str, Any]:
        """Return the second argument of subscription callbacks. DDS does not provide the sequence numbers."""
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
    """A participant of this process in a DDS domain."""

    def __init__(self, domain_id: int, enclave: str) -> None:
        """Join a domain.

        :param enclave: its keys are used where the environment asks for security.
        :raises RCLError: if the environment or its keys do not allow it.
        """
        self.domain_id = domain_id
        properties = security.properties(enclave, os.environ)
        with log.kept() if properties else nullcontext(str) as reasons:
            domain.enter(domain_id)
            try:
                with qos.participant_qos(f"enclave={enclave};", properties) as participant_qos:
                    self.handle = blocking.dds_create_participant(domain_id, participant_qos, None)
                checked(self.handle, f"cannot join DDS domain {domain_id}{reasons()}")
            except Exception:
                domain.leave(domain_id)
                raise
        if properties:
            security.give_way()
        self.gid = _guid(self.handle)
        self.publisher = checked(blocking.dds_create_publisher(self.handle, None, None), "publisher")
        self.subscriber = checked(blocking.dds_create_subscriber(self.handle, None, None), "subscriber")
        self._sertype = None if IS_RECENT else self._find_sertype()

    def create_discovery(self) -> Discovery:
        return Discovery(self.handle)

    def close(self) -> None:
        """Leave the domain and notify peers, which need not wait for the end of a lease."""
        blocking.dds_delete(self.handle)
        domain.leave(self.domain_id)

    def _topic(self, name: str, type_name: str) -> int:
        descriptor = TopicDescriptor(size=1, align=1, typename=type_name.encode(), nops=2, ops=_OPAQUE)
        handle = blocking.dds_create_topic(self.handle, ct.byref(descriptor), name.encode(), None, None)
        return checked(handle, f"cannot create topic {name} of type {type_name}")

    def _find_sertype(self) -> int:
        """Return a type for the samples of all writers. Version 0.10 of Cyclone has no function for it.

        It is in a sample that is written and taken here. The topic, which keeps it, is one that each enclave
        may use. Nobody else has its type, so nothing is sent.
        """
        topic = self._topic("ros_discovery_info", "octet")
        reader = checked(blocking.dds_create_reader(self.subscriber, topic, None, None), "reader")
        writer = checked(blocking.dds_create_writer(self.publisher, topic, None, None), "writer")
        checked(blocking.dds_write(writer, ct.byref(ct.c_uint8())), "cannot write")
        serdata, info = Serdata(), SampleInfo()
        entity = Entity.from_param(reader)
        checked(
            quick.dds_takecdr(entity, ct.byref(serdata), _ONE_SAMPLE, ct.byref(info), _ANY), "cannot take"
        )
        sertype: int = SerdataHeader.from_address(serdata.value or 0).type
        quick.ddsi_serdata_unref(serdata)
        blocking.dds_delete(writer)
        blocking.dds_delete(reader)
        return sertype

    def _sertype_of(self, writer: int) -> int:
        if self._sertype is not None:
            return self._sertype
        sertype = Pointer()
        checked(quick.dds_get_entity_sertype(writer, ct.byref(sertype)), "cannot read a writer's type")
        assert sertype.value is not None
        return sertype.value

    def create_writer(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Writer:
        """Create a writer on the DDS topic ``topic`` (mangled: ``rt/...``) of DDS type ``type_name``."""
        handle = self._topic(topic, type_name)
        try:
            with qos.endpoint_qos(profile, user_data) as writer_qos:
                writer = blocking.dds_create_writer(self.publisher, handle, writer_qos, None)
            checked(writer, f"cannot create a writer on {topic}")
            return Writer(writer, self._sertype_of(writer))
        finally:
            blocking.dds_delete(handle)

    def create_reader(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Reader:
        """Create a reader on the DDS topic ``topic`` (mangled: ``rt/...``) of DDS type ``type_name``."""
        handle = self._topic(topic, type_name)
        try:
            with qos.endpoint_qos(profile, user_data) as reader_qos:
                reader = blocking.dds_create_reader(self.subscriber, handle, reader_qos, None)
            return Reader(checked(reader, f"cannot create a reader on {topic}"))
        finally:
            blocking.dds_delete(handle)


@cache
def _keep_memory() -> None:
    """Make malloc keep what large messages free: new memory of the kernel costs ten times as much as a copy.

    By default, glibc keeps up to twice the largest block that was ever freed, of at most 32 MiB (mallopt(3),
    M_MMAP_THRESHOLD). This one is never touched, so it takes no memory.
    """
    bytes(30_000_000)


class _Loan:
    """Returns memory to DDS when nothing refers to it any more: for less than a finalizer costs."""

    __slots__ = ("_lent", "_vector")

    def __init__(self, lent: int, vector: Any) -> None:
        self._lent, self._vector = lent, vector

    def __del__(self, dds: Any = quick, is_ending: Any = is_finalizing) -> None:
        if not is_ending():  # DDS may have gone by then
            dds.ddsi_serdata_to_ser_unref(self._lent, self._vector)


_Vector = ct.c_size_t * 2  # struct iovec
_Octets = ct.c_ubyte * 2**32  # as many as a sample may have; a type for each size would cost more


def _loan(serdata: Serdata, size: int) -> memoryview:
    """Return the octets of a sample in DDS's own memory, which is freed when nothing refers to them."""
    _keep_memory()
    vector = _Vector()
    lent = quick.ddsi_serdata_to_ser_ref(serdata, 0, size, vector)
    octets: Any = _Octets.from_address(vector[0])
    octets.loan = _Loan(lent, vector)
    return memoryview(octets).cast("B")[:size]


def _vectors(data: Pieces) -> tuple[int, bytes]:
    """Return the number of the pieces, and where they are; they must not be freed before it."""
    _keep_memory()
    numbers = array("L")
    for piece in data.pieces:
        if piece:
            numbers.extend((ct.addressof(ct.c_char.from_buffer(piece)), len(piece)))
    return len(numbers) // 2, numbers.tobytes()


class _Endpoint(Handle):
    """A DDS writer or reader. Wait sets attach its ``handle`` for its statuses."""

    def __init__(self, handle: int) -> None:
        self.handle = handle
        self._rclpy_entity = Entity.from_param(handle)
        # Of the latest message: most messages of a topic have the same.
        self._size = 0, ct.c_size_t.from_param(0)
        self.logger_name = ""  # of the node that it belongs to
        self.gid = _guid(handle)

    def watch(self, statuses: list[str]) -> None:
        """Make changes of the named statuses, and of no others, trigger wait sets."""
        status.watch(self.handle, statuses)

    def watch_also(self, name: str) -> None:
        status.watch_also(self.handle, name)

    def changed(self, name: str) -> dict[str, int] | None:
        """Return the fields of a status if it has changed since the last call, else ``None``."""
        return status.changed(self.handle, name)


class Writer(_Endpoint):
    def __init__(self, handle: int, sertype: int) -> None:
        super().__init__(handle)
        # None once closed: DDS frees it with the writer.
        self._sertype: Any = Pointer.from_param(sertype)
        instance = ct.c_uint64()
        checked(quick.dds_get_instance_handle(handle, ct.byref(instance)), "cannot read a writer's handle")
        self.instance_handle = instance.value

    def write(self, data: bytes | Pieces) -> None:
        """Write CDR with its header; may block if reliable. Raises InvalidHandle if closed meanwhile."""
        if len(data) & 3:  # RTPS pads to four octets; Cyclone would pad with uninitialized memory
            data += bytes(-len(data) & 3)  # type: ignore[operator]
        octets = len(data)
        known, size = self._size
        if known != octets:
            size = ct.c_size_t.from_param(octets)
            self._size = octets, size
        if data.__class__ is Pieces:
            number, vectors = _vectors(data)
            count = ct.c_size_t.from_param(number)
        else:
            count, vectors = _ONE_PIECE, pack_vector(id(data) + BYTES_HEADER, octets)
        sertype = self._sertype  # until the end of the next call, no other thread runs Python code
        if sertype is None:
            raise InvalidHandle("cannot use a writer that was destroyed")
        serdata = quick.ddsi_serdata_from_ser_iov(sertype, _DATA, count, vectors, size)
        del data  # other threads may change the message from here on
        if not serdata:
            raise ValueError(f"invalid CDR of {octets} octets: it needs an encapsulation header and data")
        result = blocking.dds_writecdr(self._rclpy_entity, serdata)
        if result:
            if self._sertype is None:
                raise InvalidHandle("cannot use a writer that was destroyed")
            checked(result, "cannot write")

    def matched(self) -> int:
        return max(0, int(quick.dds_get_matched_subscriptions(self.handle, None, 0)))

    def matched_user_data(self) -> list[str]:
        handles = _matched_handles(self.handle, "dds_get_matched_subscriptions")
        found = (_user_data(self.handle, "dds_get_matched_subscription_data", other) for other in handles)
        return [data for data in found if data is not None]

    def wait_for_acks(self, timeout: int) -> bool:
        """Wait at most ``timeout`` [ns] until all reliable readers have acknowledged all samples."""
        result = blocking.dds_wait_for_acks(self.handle, timeout)
        return result != TIMEOUT and checked(result, "cannot wait for acknowledgements") == 0

    def assert_liveliness(self) -> None:
        """Assert that the application of this writer is alive (liveliness MANUAL_BY_TOPIC)."""
        checked(blocking.dds_assert_liveliness(self.handle), "cannot assert liveliness")

    def close(self) -> None:
        """Close the writer; unacknowledged samples are lost."""
        self._sertype = None
        blocking.dds_delete(self.handle)


class Reader(_Endpoint):
    """A DDS reader of CDR. Wait sets attach its ``condition``."""

    def __init__(self, handle: int) -> None:
        super().__init__(handle)
        self.condition = checked(blocking.dds_create_readcondition(handle, ANY_STATE), "read condition")
        # DDS returns a sample in a buffer. Each taking thread uses one; they are reused, as creation is slow.
        self._buffers: list[tuple[Serdata, SampleInfo, tuple[Any, ...]]] = []

    def take(self, lend: bool = False) -> Sample | None:
        """Return the next message, ``None`` if there is none. Several threads may take.

        :param lend: whether the data of a large message may be a view of DDS's own memory instead of bytes.
        """
        try:
            buffer = self._buffers.pop()
        except IndexError:
            serdata, info = Serdata(), SampleInfo()
            to_serdata, to_info = ct.byref(serdata), ct.byref(info)
            buffer = serdata, info, (self._rclpy_entity, to_serdata, _ONE_SAMPLE, to_info, _ANY)
        serdata, info, arguments = buffer
        sample = None
        while quick.dds_takecdr(*arguments) > 0:
            if info.valid_data:
                octets = quick.ddsi_serdata_size(serdata)
                if lend and octets >= LARGE:
                    data: Any = _loan(serdata, octets)
                else:
                    known, size = self._size
                    if known != octets:
                        size = ct.c_size_t.from_param(octets)
                        self._size = octets, size
                    data = bytes(octets)  # no other reference exists yet, so it may be written to
                    quick.ddsi_serdata_to_ser(serdata, _BEGINNING, size, data)
                # Without Sample(): where messages are rare, each call costs most.
                sample = tuple.__new__(Sample, (data, info.source_timestamp, info.publication_handle))
            quick.ddsi_serdata_unref(serdata)
            if sample is not None:  # else the sample is a change of state without a message
                break
        self._buffers.append(buffer)
        return sample

    def take_message(self, msg_type: Any, raw: bool) -> tuple[Any, dict[str, Any]] | None:
        """Return the next message and its info, ``None`` if there is none: for polling a subscription.

        :param raw: whether to return the serialized message.
        :raises RCLError: if it is not a message of ``msg_type``.
        """
        sample = self.take(not raw)
        if sample is None:
            return None
        try:
            message = sample.data if raw else msg_type._deserialize(sample.data)
        except ValueError as error:
            raise RCLError(f"failed to take message: {error}") from error
        return message, sample.info()

    def matched(self) -> int:
        return max(0, int(quick.dds_get_matched_publications(self.handle, None, 0)))

    def matched_user_data(self) -> list[str]:
        handles = _matched_handles(self.handle, "dds_get_matched_publications")
        return [data for other in handles if (data := self.user_data_of(other)) is not None]

    def user_data_of(self, publication_handle: int) -> str | None:
        """Return the USER_DATA of a matched writer, ``None`` if it is no longer matched."""
        return _user_data(self.handle, "dds_get_matched_publication_data", publication_handle)

    def close(self) -> None:
        blocking.dds_delete(self.handle)


class GuardCondition:
    """A condition that any thread can trigger to end a wait."""

    def __init__(self) -> None:
        self.handle = checked(blocking.dds_create_guardcondition(LIBRARY_HANDLE), "guard condition")

    def trigger(self) -> None:
        """Trigger the condition: waits on it end."""
        blocking.dds_set_guardcondition(self.handle, True)

    def take(self) -> None:
        """Reset the condition; a later trigger ends the next wait."""
        blocking.dds_take_guardcondition(self.handle, ct.byref(ct.c_bool()))

    def close(self) -> None:
        blocking.dds_delete(self.handle)


class WaitSet:
    """Waits for any of the attached conditions or entities, with the interpreter lock released."""

    def __init__(self) -> None:
        self.handle = checked(blocking.dds_create_waitset(LIBRARY_HANDLE), "cannot create a wait set")
        self._attached = 0
        self._allocate(0)
        self.closed = False

    def _allocate(self, capacity: int) -> None:
        self._capacity = capacity
        tokens, timeout = (ct.c_ssize_t * capacity)(), Duration()
        # Converted once: a wait follows every callback, and the conversion costs more than the call.
        entity, size = Entity.from_param(self.handle), ct.c_size_t.from_param(capacity)
        self._buffer = tokens, timeout, (entity, ct.byref(tokens), size, timeout)

    def attach(self, handle: int, token: int) -> bool:
        """Add a condition or entity, which ``wait`` reports as ``token``; False if it no longer exists."""
        if blocking.dds_waitset_attach(self.handle, handle, token) != 0:
            return False
        self._attached += 1
        if self._attached > self._capacity:
            self._allocate(2 * self._attached + 8)
        return True

    def detach(self, handle: int) -> None:
        """Remove a condition or entity. DDS itself removes deleted ones."""
        blocking.dds_waitset_detach(self.handle, handle)
        self._attached -= 1

    def wait(self, timeout: int) -> list[int]:
        """Wait at most ``timeout`` [ns]; return the tokens that are triggered."""
        # Keeps the buffer alive: DDS writes into it, and another thread may attach more and replace it.
        tokens, duration, arguments = self._buffer
        duration.value = timeout
        count = blocking.dds_waitset_wait(*arguments)
        if not count or self.closed:
            return []
        if count < 0:  # here: most waits save the call
            checked(count, "cannot wait")
        return [tokens[0]] if count == 1 else tokens[: min(count, len(tokens))]  # one is what most waits find

    def close(self) -> None:
        """Close the wait set and end its waits; attached conditions and entities stay open."""
        self.closed = True
        blocking.dds_delete(self.handle)
