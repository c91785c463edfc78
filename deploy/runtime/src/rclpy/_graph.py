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

from rclpy import _best_available, _dds
from rclpy._dds import INFINITY, Reader, Writer
from rclpy._dds.discovery import Discovery
from rclpy._discovery_info import READER_QOS, TOPIC, TYPE, TYPE_HASH, WRITER_QOS, NodeEntities, encode
from rclpy._graph_queries import GraphQueries
from rclpy._peers import Peers
from rclpy.qos import QoSProfile

if TYPE_CHECKING:
    from rclpy.node import Node


class _OwnNode(NodeEntities):
    """A node of this process, with its endpoints and a callback for its garbage collection."""

    __slots__ = ("dropped", "endpoints")

    def __init__(self, node: Node, dropped: Callable[[], None]) -> None:
        super().__init__(node._rclpy_namespace, node._rclpy_name)
        self.endpoints: list[Writer | Reader] = []
        self.dropped = dropped


_PAUSE = 0.1  # [s], before announcements are read that no caller waits for


class Graph(GraphQueries):
    """The graph as this process sees it; announces the nodes of this process to others."""

    def __init__(self, domain_id: int, enclave: str) -> None:
        super().__init__()
        self._lock = threading.RLock()
        self.participant = _dds.Participant(domain_id, enclave)
        hash_ = f"typehash={TYPE_HASH};"
        self._writer = self.participant.create_writer(TOPIC, TYPE, WRITER_QOS, hash_)
        reader = self.participant.create_reader(TOPIC, TYPE, READER_QOS, hash_)
        self._own: dict[weakref.ref[Node], _OwnNode] = {}  # weak: they do not keep a node alive
        self._dropped: deque[weakref.ref[Node]] = deque()
        self._drops = _dds.GuardCondition()
        self._deferred = 0
        self._discovery: Discovery | None = None  # made on the first query
        self._peers = Peers(reader)
        self._service_ids = 0
        self._waiting: dict[_dds.GuardCondition, None] = {}  # in order
        self._waitset = _dds.WaitSet()
        self._waitset.attach(reader.condition, 0)
        self._waitset.attach(self._drops.handle, 0)
        self._closing = threading.Event()
        self._listener = threading.Thread(target=self._listen, name="rclpy-graph", daemon=True)
        self._listener.start()

    def close(self) -> None:
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
        """Announce a node until it is removed, or dropped: then the graph's thread calls ``dropped``."""
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
        """Tell the listening thread that a node was garbage-collected.

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
        self._add(node, writer, lambda own: own.writers)
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
        self._add(node, reader, lambda own: own.readers)
        return reader

    def _add(self, node: Node, endpoint: Writer | Reader, gids: Callable[[_OwnNode], list[bytes]]) -> None:
        """Announce an endpoint of ``node`` among those of its kind."""
        endpoint.logger_name = node._logger.name

        def add(own: _OwnNode) -> None:
            gids(own).append(endpoint.gid)
            own.endpoints.append(endpoint)

        self._change(node, add)

    def destroy(self, node: Node, *endpoints: Writer | Reader) -> None:
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
                self._peers.take(self._discovered)
                if self._discovery is not None:
                    self._discovery.forget_gone()
                for guard in list(self._waiting):
                    guard.trigger()
            self._remove_dropped()  # without the lock: the callbacks may wait for other threads

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
        """Wait until ``condition`` is true; check it whenever the graph changes.

        :param timeout: [s]; ``None`` or negative: no limit.
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
        with self._lock:
            own: list[NodeEntities] = [*self._own.values()]
            known = {**self._peers.nodes(self._discovered), self.participant.gid: own}
            for gid, nodes in known.items():
                for node in nodes:
                    yield gid, node
