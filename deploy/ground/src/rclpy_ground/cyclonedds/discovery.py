"""The results of DDS discovery: participants, writers and readers of all processes in the domain."""

from __future__ import annotations

import ctypes as ct
import threading
from collections.abc import Callable, Iterator
from typing import Any

from rclpy_ground.interface import Endpoint

from . import qos
from .library import (
    BUILTIN_PARTICIPANTS,
    BUILTIN_PUBLICATIONS,
    BUILTIN_SUBSCRIPTIONS,
    BuiltinEndpoint,
    BuiltinParticipant,
    Pointer,
    SampleInfo,
    blocking,
    checked,
)

_NOT_READ = 0x7E  # ANY_STATE without the sample state "read"
_ALIVE = 16
_NOT_ALIVE = 3 | 12 | 32 | 64  # any sample and view state, instance disposed or without writers
_BATCH = 64


class _BuiltinReader:
    """Reads one of Cyclone's built-in topics, and keeps the entities that exist.

    Each entity is read once, when it is new: reading all of them repeatedly would be slow in a large domain.
    """

    def __init__(
        self, participant: int, topic: int, structure: type[ct.Structure], convert: Callable[[Any], Any]
    ) -> None:
        self._structure = ct.POINTER(structure)
        self._convert = convert
        self._lock = threading.Lock()
        self._known: dict[int, Any] = {}
        self._alive: list[Any] | None = None  # what is known, until that changes
        self.handle = checked(blocking.dds_create_reader(participant, topic, None, None), "built-in reader")
        self.news = checked(blocking.dds_create_readcondition(self.handle, _NOT_READ), "read condition")
        self.gone = checked(blocking.dds_create_readcondition(self.handle, _NOT_ALIVE), "read condition")

    def _samples(self, operation: str, mask: int) -> Iterator[tuple[Any, SampleInfo]]:
        read = getattr(blocking, operation)
        count = _BATCH
        while count == _BATCH:
            samples = (Pointer * _BATCH)()
            infos = (SampleInfo * _BATCH)()
            count = checked(read(self.handle, samples, infos, _BATCH, _BATCH, mask), "discovery")
            try:
                for index in range(count):
                    yield ct.cast(samples[index] or 0, self._structure).contents, infos[index]
            finally:
                if count:
                    blocking.dds_return_loan(self.handle, samples, count)

    def alive(self) -> list[Any]:
        """Return the existing entities, converted from the C structure, without those converted to None.

        It is the same list while nothing changes.
        """
        with self._lock:
            if blocking.dds_triggered(self.news):
                self._alive = None
                for structure, info in self._samples("dds_read_mask", _NOT_READ):
                    if info.instance_state != _ALIVE:
                        self._known.pop(info.instance_handle, None)
                    elif info.valid_data and (found := self._convert(structure)) is not None:
                        self._known[info.instance_handle] = found
            if self._alive is None:
                self._alive = list(self._known.values())
            return self._alive

    def forget_gone(self) -> None:
        """Remove entities that no longer exist."""
        with self._lock:
            for _, info in self._samples("dds_take_mask", _NOT_ALIVE):
                self._known.pop(info.instance_handle, None)
                self._alive = None


class Discovery:
    def __init__(self, participant: int) -> None:
        self._participants = _BuiltinReader(
            participant, BUILTIN_PARTICIPANTS, BuiltinParticipant, _participant
        )
        self._writers = _BuiltinReader(participant, BUILTIN_PUBLICATIONS, BuiltinEndpoint, _endpoint)
        self._readers = _BuiltinReader(participant, BUILTIN_SUBSCRIPTIONS, BuiltinEndpoint, _endpoint)

    @property
    def gone(self) -> list[int]:
        return [self._participants.gone, self._writers.gone, self._readers.gone]

    def forget_gone(self) -> None:
        """Remove entities that no longer exist, here and in DDS."""
        self._participants.forget_gone()
        self._writers.forget_gone()
        self._readers.forget_gone()

    def participants(self) -> dict[bytes, str]:
        return dict(self._participants.alive())

    def writers(self) -> list[Endpoint]:
        return self._writers.alive()

    def readers(self) -> list[Endpoint]:
        return self._readers.alive()


def _participant(found: BuiltinParticipant) -> tuple[bytes, str]:
    return bytes(found.key.bytes), qos.user_data(found.qos)


def _endpoint(found: BuiltinEndpoint) -> Endpoint | None:
    if found.type_name.startswith(b"org::eclipse::cyclonedds::builtin::"):
        return None  # a built-in reader of this process: Cyclone lists it but does not announce it
    return Endpoint(
        gid=bytes(found.key.bytes),
        participant=bytes(found.participant_key.bytes),
        topic=found.topic_name.decode(errors="replace"),
        type_name=found.type_name.decode(errors="replace"),
        user_data=qos.user_data(found.qos),
        profile=qos.profile_of(found.qos),
    )
