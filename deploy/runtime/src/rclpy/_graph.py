"""The ROS graph: the nodes that exist, with their publishers, subscriptions, services and clients.

DDS discovers endpoints. The topic ``ros_discovery_info`` tells which node they belong to: every process
publishes its latest ``rmw_dds_common/msg/ParticipantEntitiesInfo`` there (facts/wire_samples.json).
"""

from __future__ import annotations

import struct
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rclpy import _best_available, _dds, _names
from rclpy._bad_input import BadInput
from rclpy._dds import INFINITY, Reader, Sample, Writer
from rclpy._dds.discovery import Discovery, Endpoint
from rclpy._dds.qos import user_data_value
from rclpy.exceptions import NodeNameNonExistentError
from rclpy.logging import get_logger
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

if TYPE_CHECKING:
    from rclpy.node import Node

_TOPIC = "ros_discovery_info"
_TYPE = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"
_TYPE_HASH = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"
_WRITER_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
_READER_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    depth=0,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

NamesAndTypes = list[tuple[str, list[str]]]


class NodeEntities:
    """A node of any process: its name and the GUIDs of its readers and writers."""

    __slots__ = ("name", "namespace", "readers", "writers")

    def __init__(self, namespace: str, name: str) -> None:
        self.namespace = namespace
        self.name = name
        self.readers: list[bytes] = []
        self.writers: list[bytes] = []


class _OwnNode(NodeEntities):
    """A node of this process, with its endpoints and a callback for its garbage collection."""

    __slots__ = ("dropped", "endpoints")

    def __init__(self, node: Node, dropped: Callable[[], None]) -> None:
        super().__init__(node._rclpy_namespace, node._rclpy_name)
        self.endpoints: list[Writer | Reader] = []
        self.dropped = dropped


def encode(gid: bytes, nodes: list[NodeEntities]) -> bytes:
    """Encode a participant's GUID and its nodes as a ParticipantEntitiesInfo in CDR.

    The message class is not used, because its arrays would make every process import NumPy.
    """
    data = bytearray(b"\x00\x01\x00\x00" + gid + struct.pack("<I", len(nodes)))

    def string(text: str) -> None:
        encoded = text.encode() + b"\0"
        data.extend(b"\0" * (-len(data) % 4) + struct.pack("<I", len(encoded)) + encoded)

    for node in nodes:
        string(node.namespace)
        string(node.name)
        for gids in (node.readers, node.writers):
            data.extend(b"\0" * (-len(data) % 4) + struct.pack("<I", len(gids)) + b"".join(gids))
    return bytes(data)


def decode(data: bytes) -> tuple[bytes, list[NodeEntities]]:
    """Decode a participant's GUID and its nodes from CDR. Raises ValueError if it is malformed."""
    position = 20

    def number() -> int:
        nonlocal position
        position += -position % 4
        (value,) = struct.unpack_from("<I", data, position)
        position += 4
        if value > len(data) - position:
            raise ValueError("a length beyond the end")
        return int(value)

    def octets(count: int) -> bytes:
        nonlocal position
        if count > len(data) - position:
            raise ValueError("a length beyond the end")
        position += count
        return data[position - count : position]

    if data[:2] != b"\x00\x01" or len(data) < position:
        raise ValueError("not a ParticipantEntitiesInfo")
    try:
        nodes = []
        for _ in range(number()):
            namespace = octets(number()).rstrip(b"\0").decode()
            node = NodeEntities(namespace, octets(number()).rstrip(b"\0").decode())
            node.readers = [octets(16) for _ in range(number())]
            node.writers = [octets(16) for _ in range(number())]
            nodes.append(node)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(str(error)) from error
    return data[4:20], nodes


# With more peers than these, dead ones are removed.
_MANY_PEERS = 100
_PAUSE = 0.1  # [s], before announcements are read that no caller waits for


class Graph:
    """The graph as this process sees it; announces the nodes of this process to others."""

    def __init__(self, domain_id: int, enclave: str) -> None:
        self._lock = threading.RLock()
        self.participant = _dds.Participant(domain_id, f"enclave={enclave};")
        hash_ = f"typehash={_TYPE_HASH};"
        self._writer = self.participant.create_writer(_TOPIC, _TYPE, _WRITER_QOS, hash_)
        self._reader = self.participant.create_reader(_TOPIC, _TYPE, _READER_QOS, hash_)
        self._own: dict[weakref.ref[Node], _OwnNode] = {}  # weak: they do not keep a node alive
        self._dropped: deque[weakref.ref[Node]] = deque()
        self._drops = _dds.GuardCondition()
        self._deferred = 0
        self._announced: dict[bytes, Sample] = {}  # by a participant's GUID; decoded on the first query
        self._bad_input = BadInput(get_logger("rclpy"), _TOPIC)
        self._peers: dict[bytes, list[NodeEntities]] = {}
        self._many_peers = _MANY_PEERS
        self._discovery: Discovery | None = None  # made on the first query
        self._topics: dict[bool, tuple[list[Endpoint], NamesAndTypes]] = {}
        self._service_ids = 0
        self._waiting: dict[_dds.GuardCondition, None] = {}  # in order
        self._waitset = _dds.WaitSet()
        self._waitset.attach(self._reader.condition, 0)
        self._waitset.attach(self._drops.handle, 0)
        self._closing = threading.Event()
        self._listener = threading.Thread(target=self._listen, name="rclpy-graph", daemon=True)
        self._listener.start()

    def close(self) -> None:
        """Leave the domain."""
        self._closing.set()
        with self._lock:  # held by the listening thread while it works
            for own in self._own.values():
                for endpoint in own.endpoints:  # so that later writes raise: DDS would close them silently
                    endpoint.close()
            self._own.clear()
            self._writer.close()
            self._waitset.close()
            self._drops.close()
            self.participant.close()
        if threading.current_thread() is not self._listener:
            # With a timeout: if a signal interrupted the holder of the lock, the thread cannot end yet.
            self._listener.join(_PAUSE)

    # Announcing the nodes of this process

    @contextmanager
    def one_announcement(self) -> Iterator[None]:
        """Announce all changes within the ``with`` at once, at its end."""
        with self._lock:
            self._deferred += 1
        try:
            yield
        finally:
            with self._lock:
                self._deferred -= 1
            self._announce()

    def _announce(self) -> None:
        with self._lock:
            if not self._deferred and not self._closing.is_set():
                self._writer.write(encode(self.participant.gid, list(self._own.values())))

    def add_node(self, node: Node, dropped: Callable[[], None]) -> None:
        """
        Announce a node of this process until it is removed or garbage-collected.

        :param dropped: called on the graph's thread after a garbage collection and the closing of endpoints.
        """
        with self._lock:
            self._own[weakref.ref(node, self._drop)] = _OwnNode(node, dropped)
        self._announce()

    def remove_node(self, node: Node) -> None:
        """Announce that a node is gone, and close its remaining endpoints."""
        self._remove(weakref.ref(node))

    def _remove(self, node: weakref.ref[Node]) -> _OwnNode | None:
        with self._lock:
            own = self._own.pop(node, None)
        self._announce()
        for endpoint in own.endpoints if own else ():
            endpoint.close()
        return own

    def _drop(self, node: weakref.ref[Node]) -> None:
        """
        Tell the listening thread that a node was garbage-collected.

        The garbage collector calls this on any thread, which may hold any lock: this must not wait for one.
        """
        self._dropped.append(node)
        self._drops.trigger()

    def _remove_dropped(self) -> None:
        while self._dropped:
            if (own := self._remove(self._dropped.popleft())) is not None:
                own.dropped()

    def _change(self, node: Node, change: Callable[[_OwnNode], None]) -> None:
        with self._lock:
            if (own := self._own.get(weakref.ref(node))) is not None:
                change(own)
        self._announce()

    def create_writer(
        self, node: Node, topic: str, msg_type: Any, profile: QoSProfile, extra: str = ""
    ) -> Writer:
        """Create a writer of ``node``; ``extra`` precedes the type hash in USER_DATA."""
        if _best_available.has_open_policy(profile):
            readers = [reader.profile for reader in self._discovered().readers() if reader.topic == topic]
            profile = _best_available.for_publisher(profile, readers)
        user_data = f"{extra}typehash={msg_type._TYPE_HASH};"
        writer = self.participant.create_writer(topic, msg_type._DDS_TYPE_NAME, profile, user_data)
        writer.logger_name = node._logger.name

        def add(own: _OwnNode) -> None:
            own.writers.append(writer.gid)
            own.endpoints.append(writer)

        self._change(node, add)
        return writer

    def create_reader(
        self, node: Node, topic: str, msg_type: Any, profile: QoSProfile, extra: str = ""
    ) -> Reader:
        """Create a reader of ``node``; ``extra`` precedes the type hash in USER_DATA."""
        if _best_available.has_open_policy(profile):
            writers = [writer.profile for writer in self._discovered().writers() if writer.topic == topic]
            profile = _best_available.for_subscription(profile, writers)
        user_data = f"{extra}typehash={msg_type._TYPE_HASH};"
        reader = self.participant.create_reader(topic, msg_type._DDS_TYPE_NAME, profile, user_data)
        reader.logger_name = node._logger.name

        def add(own: _OwnNode) -> None:
            own.readers.append(reader.gid)
            own.endpoints.append(reader)

        self._change(node, add)
        return reader

    def destroy(self, node: Node, *endpoints: Writer | Reader) -> None:
        """Close readers and writers of ``node``."""
        gone = {endpoint.gid for endpoint in endpoints}

        def remove(own: _OwnNode) -> None:
            own.readers = [gid for gid in own.readers if gid not in gone]
            own.writers = [gid for gid in own.writers if gid not in gone]
            own.endpoints = [endpoint for endpoint in own.endpoints if endpoint.gid not in gone]

        self._change(node, remove)
        for endpoint in endpoints:
            endpoint.close()

    def next_service_id(self) -> bytes:
        """Return an identifier for a service or client that is unique in the domain."""
        with self._lock:
            self._service_ids += 1
            return self.participant.gid[:12] + struct.pack(">I", self._service_ids)

    # Listening to the other processes

    def _listen(self) -> None:
        """Take the announcements of peers, which would pile up if no executor spins and no query is made.

        This needs a separate thread, as in ROS 2.
        """
        while True:
            self._waitset.wait(INFINITY)
            if not self._waiting:  # starting peers announce themselves often: handle several announcements
                self._closing.wait(_PAUSE)
            with self._lock:
                if self._waitset.closed:
                    return
                self._drops.take()
                self._take()
                if self._discovery is not None:
                    self._discovery.forget_gone()
                for guard in list(self._waiting):
                    guard.trigger()
            self._remove_dropped()  # without the lock: the callbacks may wait for other threads

    def _take(self) -> None:
        """Keep the latest announcement of each peer."""
        with self._lock:
            while (sample := self._reader.take()) is not None:
                self._announced[sample.data[4:20]] = sample
            if len(self._announced) + len(self._peers) > self._many_peers:
                self._forget_dead_peers()
                self._many_peers = max(_MANY_PEERS, 2 * len(self._peers))

    def _forget_dead_peers(self) -> None:
        """Decode the announcements; keep those of participants that exist."""
        while self._announced:
            sample = self._announced.popitem()[1]
            try:
                gid, nodes = decode(sample.data)
            except ValueError as error:
                self._bad_input.drop(sample, error)
            else:
                self._peers[gid] = nodes
        for gid in self._peers.keys() - self._discovered().participants().keys():
            del self._peers[gid]

    def _discovered(self) -> Discovery:
        with self._lock:
            if self._discovery is None:
                self._discovery = self.participant.create_discovery()
                for condition in self._discovery.gone:
                    self._waitset.attach(condition, 0)
            return self._discovery

    def wait_for(
        self, condition: Callable[[], bool], timeout: float | None, alive: Callable[[], bool]
    ) -> bool:
        """
        Wait until ``condition`` is true; check it whenever the graph changes.

        :param timeout: [s]; ``None`` or negative: for ever.
        :param alive: called at least ten times a second; the wait ends when it returns False.
        :return: whether the condition became true.
        """
        deadline = None if timeout is None or timeout < 0 else time.monotonic() + timeout
        waitset, guard = _dds.WaitSet(), _dds.GuardCondition()
        with self._lock:
            self._waiting[guard] = None
        try:
            for handle in (*self._discovered().news, guard.handle):
                waitset.attach(handle, 0)
            while not condition():
                remaining = 0.1 if deadline is None else min(0.1, deadline - time.monotonic())
                if remaining <= 0 or not alive():
                    return False
                waitset.wait(int(remaining * 1e9))
                guard.take()
                if not alive():  # the domain may have been left meanwhile
                    return False
                self._discovered().refresh()
            return True
        finally:
            with self._lock:
                self._waiting.pop(guard, None)
            waitset.close()
            guard.close()

    def _nodes(self) -> Iterator[tuple[bytes, NodeEntities]]:
        """Every known node, with its participant's GUID."""
        with self._lock:
            self._take()
            self._forget_dead_peers()
            own: list[NodeEntities] = [*self._own.values()]
            known = {**self._peers, self.participant.gid: own}
            for gid, nodes in known.items():
                for node in nodes:
                    yield gid, node

    def node_names(self) -> list[tuple[str, str, str]]:
        """Return name, namespace and enclave of every node."""
        enclaves = self._discovered().participants()
        return [
            (node.name, node.namespace, user_data_value(enclaves.get(gid, ""), "enclave") or "/")
            for gid, node in self._nodes()
        ]

    def _with_owners(self, endpoints: list[Endpoint]) -> list[tuple[Endpoint, str, str]]:
        """Each endpoint with name and namespace of its node, or ROS 2's names for an unknown node."""
        nodes: dict[bytes, list[NodeEntities]] = {}
        for gid, node in self._nodes():
            nodes.setdefault(gid, []).append(node)
        return [(endpoint, *_owner(endpoint, nodes.get(endpoint.participant, []))) for endpoint in endpoints]

    def _writers_and_readers(self) -> list[Endpoint]:
        return self._discovered().writers() + self._discovered().readers()

    def topic_names_and_types(self, no_demangle: bool) -> NamesAndTypes:
        """Return every topic that has a reader or writer, with its types."""
        endpoints = self._writers_and_readers()
        known, names = self._topics.get(no_demangle, ([], []))
        if endpoints != known:  # collecting them is slow in a large domain, and some programs ask often
            names = _collect_topics(endpoints, no_demangle)
            self._topics[no_demangle] = (endpoints, names)
        return [(name, list(types)) for name, types in names]

    def service_names_and_types(self) -> NamesAndTypes:
        """Return every service that has a server or client, with its types."""
        return _collect_services(self._writers_and_readers())

    def _of_node(self, name: str, namespace: str, kind: str, endpoints: list[Endpoint]) -> list[Endpoint]:
        gids: set[bytes] = set()
        found = False
        for _, node in self._nodes():
            if (node.name, node.namespace) == (name, namespace):
                found = True
                gids.update(getattr(node, kind))
        if not found:
            raise NodeNameNonExistentError(f"Cannot find the node {namespace.rstrip('/')}/{name}")
        return [endpoint for endpoint in endpoints if endpoint.gid in gids]

    def publishers_of_node(self, name: str, namespace: str, no_demangle: bool) -> NamesAndTypes:
        """Return the topics that a node publishes."""
        writers = self._of_node(name, namespace, "writers", self._discovered().writers())
        return _collect_topics(writers, no_demangle)

    def subscriptions_of_node(self, name: str, namespace: str, no_demangle: bool) -> NamesAndTypes:
        """Return the topics that a node subscribes to."""
        readers = self._of_node(name, namespace, "readers", self._discovered().readers())
        return _collect_topics(readers, no_demangle)

    def services_of_node(self, name: str, namespace: str) -> NamesAndTypes:
        """Return the services that a node serves: it reads their requests."""
        readers = self._of_node(name, namespace, "readers", self._discovered().readers())
        return _collect_services([reader for reader in readers if reader.topic.startswith("rq/")])

    def clients_of_node(self, name: str, namespace: str) -> NamesAndTypes:
        """Return the services that a node calls: it reads their replies."""
        readers = self._of_node(name, namespace, "readers", self._discovered().readers())
        return _collect_services([reader for reader in readers if reader.topic.startswith("rr/")])

    def writers_of(self, dds_topic: str) -> list[tuple[Endpoint, str, str]]:
        """Return the writers on a topic, each with its node's name and namespace."""
        return self._with_owners([w for w in self._discovered().writers() if w.topic == dds_topic])

    def readers_of(self, dds_topic: str) -> list[tuple[Endpoint, str, str]]:
        """Return the readers on a topic, each with its node's name and namespace."""
        return self._with_owners([r for r in self._discovered().readers() if r.topic == dds_topic])

    def count_writers(self, dds_topic: str) -> int:
        """Return the number of writers on a topic."""
        return sum(writer.topic == dds_topic for writer in self._discovered().writers())

    def count_readers(self, dds_topic: str) -> int:
        """Return the number of readers on a topic."""
        return sum(reader.topic == dds_topic for reader in self._discovered().readers())


def _owner(endpoint: Endpoint, nodes: list[NodeEntities]) -> tuple[str, str]:
    """Name and namespace of the endpoint's node, which is one of its participant's nodes."""
    for node in nodes:
        if endpoint.gid in node.readers or endpoint.gid in node.writers:
            return node.name, node.namespace
    return "_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_"


def _sorted(found: dict[str, set[str]]) -> NamesAndTypes:
    return [(name, sorted(types)) for name, types in sorted(found.items())]


def _collect_topics(endpoints: list[Endpoint], no_demangle: bool) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for topic, type_name in {(endpoint.topic, endpoint.type_name) for endpoint in endpoints}:
        if no_demangle:
            found.setdefault(topic, set()).add(type_name)
        elif (name := _names.topic_from_dds(topic)) is not None:
            found.setdefault(name, set()).add(_names.type_from_dds(type_name))
    return _sorted(found)


def _collect_services(endpoints: list[Endpoint]) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for endpoint in endpoints:
        if (name := _names.service_from_dds(endpoint.topic)) is not None:
            found.setdefault(name, set()).add(_names.service_type_from_dds(endpoint.type_name))
    return _sorted(found)
