"""DDS entities as thin Python objects: explicitly closed, and optimized on the path of messages."""

from __future__ import annotations

import ctypes as ct
import os
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

from rclpy.qos import QoSProfile

from rclpy_ground.genuine import InvalidHandle
from rclpy_ground.interface import Sample

from . import domain, log, qos, security, status
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


class _Endpoint:
    """A DDS writer or reader. Wait sets attach its ``handle`` for its statuses."""

    _matching: str
    """What it is matched with, as functions of DDS name it."""

    def __init__(self, handle: int) -> None:
        self.handle = handle
        self._entity = Entity.from_param(handle)
        # Of the latest message: most messages of a topic have the same.
        self._size = 0, ct.c_size_t.from_param(0)
        self.gid = _guid(handle)
        instance = ct.c_uint64()
        checked(quick.dds_get_instance_handle(handle, ct.byref(instance)), "cannot read an instance handle")
        self.instance_handle = instance.value
        self.closed: Callable[[], None] | None = None
        """Is called once it is closed."""

    def close(self) -> None:
        blocking.dds_delete(self.handle)
        closed, self.closed = self.closed, None
        if closed is not None:
            closed()

    def watch(self, statuses: list[str]) -> None:
        """Make changes of the named statuses, and of no others, trigger wait sets."""
        status.watch(self.handle, statuses)

    def watch_also(self, name: str) -> None:
        status.watch_also(self.handle, name)

    def changed(self, name: str) -> dict[str, int] | None:
        """Return the fields of a status if it has changed since the last call, else ``None``."""
        return status.changed(self.handle, name)

    def _matched(self, handles: Any = None, size: int = 0) -> int:
        return max(0, int(getattr(quick, f"dds_get_matched_{self._matching}s")(self.handle, handles, size)))

    def matched(self) -> int:
        return self._matched()

    def matched_user_data(self) -> list[str]:
        handles = (ct.c_uint64 * self._matched())()
        count = self._matched(handles, len(handles))
        return [data for other in handles[:count] if (data := self.user_data_of(other)) is not None]

    def user_data_of(self, other: int) -> str | None:
        """Return the USER_DATA of a matched endpoint, ``None`` if it is no longer matched."""
        found = getattr(quick, f"dds_get_matched_{self._matching}_data")(self.handle, other)
        if not found:
            return None
        try:
            return qos.user_data(found.contents.qos)
        finally:
            quick.dds_builtintopic_free_endpoint(found)


class Writer(_Endpoint):
    _matching = "subscription"

    def __init__(self, handle: int, sertype: int) -> None:
        super().__init__(handle)
        # None once closed: DDS frees it with the writer.
        self._sertype: Any = Pointer.from_param(sertype)

    def write(self, data: bytes, *, is_request: bool = False) -> None:
        """Write CDR with its header; may block if reliable. Raises InvalidHandle if closed meanwhile.

        A request keeps the interpreter lock, as in rclpy: its ActionClient loses an answer that another
        thread takes before ``send_request`` has returned.
        """
        if len(data) & 3:  # RTPS pads to four octets; Cyclone would pad with uninitialized memory
            data += bytes(-len(data) & 3)
        octets = len(data)
        known, size = self._size
        if known != octets:
            size = ct.c_size_t.from_param(octets)
            self._size = octets, size
        vectors = pack_vector(id(data) + BYTES_HEADER, octets)
        sertype = self._sertype  # until the end of the next call, no other thread runs Python code
        if sertype is None:
            raise InvalidHandle("cannot use a writer that was destroyed")
        serdata = quick.ddsi_serdata_from_ser_iov(sertype, _DATA, _ONE_PIECE, vectors, size)
        del data  # other threads may change the message from here on
        if not serdata:
            raise ValueError(f"invalid CDR of {octets} octets: it needs an encapsulation header and data")
        result = (quick if is_request else blocking).dds_writecdr(self._entity, serdata)
        if result:
            if self._sertype is None:
                raise InvalidHandle("cannot use a writer that was destroyed")
            checked(result, "cannot write")

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
        super().close()


class Reader(_Endpoint):
    """A DDS reader of CDR. Wait sets attach its ``condition``."""

    _matching = "publication"

    def __init__(self, handle: int) -> None:
        super().__init__(handle)
        self.condition = checked(blocking.dds_create_readcondition(handle, ANY_STATE), "read condition")
        # DDS returns a sample in a buffer. Each taking thread uses one; they are reused, as creation is slow.
        self._buffers: list[tuple[Serdata, SampleInfo, tuple[Any, ...]]] = []

    def take(self) -> Sample | None:
        """Return the next message, ``None`` if there is none. Several threads may take."""
        try:
            buffer = self._buffers.pop()
        except IndexError:
            serdata, info = Serdata(), SampleInfo()
            to_serdata, to_info = ct.byref(serdata), ct.byref(info)
            buffer = serdata, info, (self._entity, to_serdata, _ONE_SAMPLE, to_info, _ANY)
        serdata, info, arguments = buffer
        sample = None
        while quick.dds_takecdr(*arguments) > 0:
            if info.valid_data:
                octets = quick.ddsi_serdata_size(serdata)
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


class GuardCondition:
    """A condition that any thread can trigger to end a wait."""

    def __init__(self) -> None:
        self.handle = checked(blocking.dds_create_guardcondition(LIBRARY_HANDLE), "guard condition")

    def trigger(self) -> None:
        """Trigger the condition: waits on it end."""
        blocking.dds_set_guardcondition(self.handle, True)

    def take(self) -> bool:
        """Reset the condition; return whether it was triggered. A later trigger ends the next wait."""
        was_triggered = ct.c_bool()
        blocking.dds_take_guardcondition(self.handle, ct.byref(was_triggered))
        return was_triggered.value

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
