"""A participant whose endpoints belong to nodes: it announces its own, and knows those of the others.

The substitute names the node of an endpoint in its USER_DATA. ROS 2 names it on a topic, so this takes the
name out of the USER_DATA of own endpoints.
"""

from __future__ import annotations

import atexit
import logging
import re
import threading
from dataclasses import replace

from rclpy.qos import QoSProfile

from rclpy_ground.interface import INFINITY, Endpoint, NodeName

from . import entities
from .announcement import (
    GID_AT,
    READER_QOS,
    TOPIC,
    TYPE,
    USER_DATA,
    WRITER_QOS,
    Entities,
    decode,
    encode,
)
from .discovery import Discovery

_NODE = re.compile(r"node=([^ ;]*) ([^ ;]*) ([^ ;]*);")
_PAUSE = 0.02
"""How long changes are collected until they are announced [s]: a node has a dozen endpoints."""
_MANY = 100
"""With more participants than these, the announcements of those that are gone are removed."""


class Participant(entities.Participant):
    def __init__(self, domain_id: int, enclave: str) -> None:
        super().__init__(domain_id, enclave)
        self._lock = threading.RLock()
        self._own: dict[NodeName, Entities] = {}
        self._announced: dict[bytes, bytes] = {}  # by the GUID of a participant
        self._names: dict[bytes, NodeName] | None = None  # of the announced endpoints, until they change
        self._many = _MANY
        self._discovery: DiscoveryWithNodes | None = None
        self._announcements = super().create_writer(TOPIC, TYPE, WRITER_QOS, USER_DATA)
        self._reader = super().create_reader(TOPIC, TYPE, READER_QOS, USER_DATA)
        self._changed = entities.GuardCondition()
        self._wait_set = entities.WaitSet()
        self._wait_set.attach(self._reader.condition, 0)
        self._wait_set.attach(self._changed.handle, 0)
        self._closing = threading.Event()
        self._listener = threading.Thread(target=self._listen, name="ros_discovery_info", daemon=True)
        self._listener.start()
        # Later, the interpreter would stop the thread for good, even while it holds the lock.
        atexit.register(self._end_listener)

    def create_writer(
        self, topic: str, type_name: str, profile: QoSProfile, user_data: str
    ) -> entities.Writer:
        node, user_data = _split(user_data)
        writer = super().create_writer(topic, type_name, profile, user_data)
        self._announce(writer, self._of_node(node).writers)
        return writer

    def create_reader(
        self, topic: str, type_name: str, profile: QoSProfile, user_data: str
    ) -> entities.Reader:
        node, user_data = _split(user_data)
        reader = super().create_reader(topic, type_name, profile, user_data)
        self._announce(reader, self._of_node(node).readers)
        return reader

    def create_discovery(self) -> DiscoveryWithNodes:
        with self._lock:
            if self._discovery is None:
                self._discovery = DiscoveryWithNodes(self)
                for condition in self._discovery.gone:
                    self._wait_set.attach(condition, 0)
            return self._discovery

    def close(self) -> None:
        atexit.unregister(self._end_listener)
        self._end_listener()
        with self._lock:
            self._wait_set.close()
            self._changed.close()
            super().close()

    def _end_listener(self) -> None:
        if self._closing.is_set():
            return
        self._closing.set()
        self._changed.trigger()
        if threading.current_thread() is not self._listener:
            # With a timeout: if a signal interrupted the holder of the lock, the thread cannot end yet.
            self._listener.join(1.0)

    def _of_node(self, node: NodeName) -> Entities:
        with self._lock:
            return self._own.setdefault(node, Entities([], []))

    def _announce(self, endpoint: entities.Writer | entities.Reader, gids: list[bytes]) -> None:
        def forget() -> None:
            with self._lock:
                gids.remove(endpoint.gid)
                for name in [name for name, own in self._own.items() if not any(own)]:
                    del self._own[name]
            self._announce_soon()

        with self._lock:
            gids.append(endpoint.gid)
            self._names = None
        endpoint.closed = forget
        self._announce_soon()

    def _announce_soon(self) -> None:
        if not self._closing.is_set():
            self._changed.trigger()

    def _listen(self) -> None:
        """Announce changes, and take the announcements of others: they would pile up without queries."""
        while not self._closing.is_set():
            self._wait_set.wait(INFINITY)
            if self._closing.wait(_PAUSE):
                return
            with self._lock:
                if self._closing.is_set():
                    return
                if self._changed.take():
                    self._announcements.write(encode(self.gid, self._own))
                self._take()
                if self._discovery is not None:
                    self._discovery.forget_gone()

    def _take(self) -> None:
        while (sample := self._reader.take()) is not None:
            self._announced[sample.data[GID_AT]] = sample.data
            self._names = None
        if len(self._announced) > self._many:
            present = self.create_discovery().participants()
            self._announced = {gid: data for gid, data in self._announced.items() if gid in present}
            self._many = max(_MANY, 2 * len(self._announced))

    def node_names(self) -> dict[bytes, NodeName]:
        """Return the node of each endpoint, by its GUID; the same mapping while nothing changes."""
        with self._lock:
            self._take()
            if self._names is not None:
                return self._names
            nodes = list(self._own.items())
            for gid, data in list(self._announced.items()):
                try:
                    nodes += decode(data) if gid != self.gid else []
                except ValueError as error:
                    logging.getLogger(__name__).warning("%s: dropped an announcement: %s", TOPIC, error)
                    del self._announced[gid]
            self._names = {gid: name for name, own in nodes for gids in own for gid in gids}
            return self._names


class DiscoveryWithNodes(Discovery):
    def __init__(self, participant: Participant) -> None:
        super().__init__(participant.handle)
        self._participant = participant
        self._named_writers, self._named_readers = _Named(), _Named()

    def writers(self) -> list[Endpoint]:
        return self._named_writers.of(super().writers(), self._participant.node_names())

    def readers(self) -> list[Endpoint]:
        return self._named_readers.of(super().readers(), self._participant.node_names())


class _Named:
    """Endpoints with their nodes: the same list while neither changes, for each service asks every second."""

    def __init__(self) -> None:
        self._last: tuple[list[Endpoint], dict[bytes, NodeName], list[Endpoint]] = [], {}, []

    def of(self, endpoints: list[Endpoint], names: dict[bytes, NodeName]) -> list[Endpoint]:
        last = self._last
        if last[0] is not endpoints or last[1] is not names:
            named = [replace(each, node=names.get(each.gid)) for each in endpoints]
            last = self._last = endpoints, names, named
        return last[2]


def _split(user_data: str) -> tuple[NodeName, str]:
    """Return the node that USER_DATA names, and the rest."""
    match = _NODE.search(user_data)
    assert match is not None, user_data
    return NodeName(*match.groups()), user_data.replace(match[0], "")
