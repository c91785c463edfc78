"""Simulated participants of ``rclpy._dds``, and what they know of each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from rclpy._dds.discovery import Endpoint as EndpointInfo
from rclpy.qos import QoSProfile
from rclpy_simulation import kernel
from rclpy_simulation.conditions import Condition
from rclpy_simulation.endpoints import Endpoint, Reader, Writer
from rclpy_simulation.link import Link
from rclpy_simulation.network import Domains


class Participant:
    """A simulated participant of the process that creates it."""

    def __init__(self, domain_id: int, user_data: str) -> None:
        process = kernel.running().process
        self.domain_id = domain_id
        self.user_data = user_data
        self.process = process
        self.host = process.host
        self.kernel = process.kernel
        self.domains: Domains = process.kernel.domains
        self.has_left = False
        self.version = 0  # of the endpoints
        self.silent_since: int | None = None  # [ns], while its process is stopped
        self.handle = self.kernel.next_number()
        self._gids = itertools.count(1)
        self.gid = b"\x01\x10\x00\x00" + self.handle.to_bytes(8, "big") + b"\x00\x00\x01\xc1"
        self.endpoints: dict[bytes, Endpoint] = {}
        self.known: dict[Participant, dict[bytes, Endpoint]] = {}
        self._known_versions: dict[Participant, int] = {}
        self._local: dict[str, list[Endpoint]] = {}  # by topic
        self._remote: dict[str, list[Endpoint]] = {}
        self._is_announcing = False
        self._discovery: Discovery | None = None
        process.participants.append(self)
        self.domains.join(self)

    def next_gid(self, kind: int) -> bytes:
        """Return the GUID of a new endpoint of a kind (RTPS 2.5, 9.3.1)."""
        return self.gid[:12] + next(self._gids).to_bytes(3, "big") + bytes([kind])

    def create_writer(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Writer:
        """Create a writer on the DDS topic ``topic`` of DDS type ``type_name``."""
        writer = Writer(self, topic, type_name, profile, user_data)
        self._add(writer)
        return writer

    def create_reader(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Reader:
        """Create a reader on the DDS topic ``topic`` of DDS type ``type_name``."""
        reader = Reader(self, topic, type_name, profile, user_data)
        self._add(reader)
        return reader

    def _add(self, endpoint: Endpoint) -> None:
        self.endpoints[endpoint.gid] = endpoint
        local = self._local.setdefault(endpoint.topic, [])
        for other in local:
            endpoint.match(other)
            other.match(endpoint)
        local.append(endpoint)
        for other in self._remote.get(endpoint.topic, ()):
            endpoint.match(other)
        self._announce()

    def remove(self, endpoint: Endpoint) -> None:
        """Remove an endpoint that was closed."""
        if self.endpoints.pop(endpoint.gid, None) is not None:
            local = self._local[endpoint.topic]
            local.remove(endpoint)
            for other in local:
                other.unmatch(endpoint)
            self._announce()

    def _announce(self) -> None:
        """Announce all changes of this moment together."""
        self._note_news()
        if not self._is_announcing and not self.has_left:
            self._is_announcing = True
            self.kernel.schedule(self.kernel.now, self._announce_now)

    def _announce_now(self) -> None:
        self._is_announcing = False
        if not self.has_left:
            self.domains.announce(self)

    # What it knows of others

    def discover(self, other: Participant) -> None:
        """Note that another participant exists, and match its endpoints."""
        if not other.has_left:
            self.known.setdefault(other, {})
            self.learn(other, tuple(other.endpoints.values()), other.version)

    def learn(self, other: Participant, endpoints: tuple[Endpoint, ...], version: int) -> None:
        """Note the present endpoints of another participant."""
        known = self.known.get(other)
        if known is None or self._known_versions.get(other, -1) > version:
            return
        self._known_versions[other] = version
        present = {endpoint.gid: endpoint for endpoint in endpoints}
        for gid in [gid for gid in known if gid not in present]:
            self._forget_endpoint(known.pop(gid))
        for gid, endpoint in present.items():
            if gid not in known:
                known[gid] = endpoint
                self._remote.setdefault(endpoint.topic, []).append(endpoint)
                for own in self._local.get(endpoint.topic, ()):
                    own.match(endpoint)
        self._note_news()

    def forget(self, other: Participant) -> None:
        """Note that another participant is gone."""
        for endpoint in self.known.pop(other, {}).values():
            self._forget_endpoint(endpoint)
        self._known_versions.pop(other, None)
        self._note_news()

    def _forget_endpoint(self, endpoint: Endpoint) -> None:
        remote = self._remote[endpoint.topic]
        remote.remove(endpoint)
        if not remote:
            del self._remote[endpoint.topic]
        for own in self._local.get(endpoint.topic, ()):
            own.unmatch(endpoint)

    def links_to(self, other: Participant) -> Iterator[Link]:
        """Yield the links to the readers of another participant."""
        for endpoint in self.endpoints.values():
            if isinstance(endpoint, Writer):
                yield from endpoint.links_to(other)

    def links_from(self, other: Participant) -> Iterator[Link]:
        """Yield the links from the writers of another participant."""
        for endpoint in self.endpoints.values():
            if isinstance(endpoint, Reader):
                yield from endpoint.links_from(other)

    def create_discovery(self) -> Discovery:
        """Return the entities that this participant discovers."""
        if self._discovery is None:
            self._discovery = Discovery(self)
        return self._discovery

    def _note_news(self) -> None:
        if self._discovery is not None:
            self._discovery.note()

    # Its end

    def close(self) -> None:
        """Leave the domain and notify the others."""
        if not self.has_left:
            self._leave()
            self.domains.leave(self)

    def vanish(self) -> None:
        """Leave the domain without a word: the process has ended."""
        if not self.has_left:
            self._leave()
            self.domains.vanish(self)

    def _leave(self) -> None:
        self.has_left = True
        self.process.participants.remove(self)
        for endpoint in list(self.endpoints.values()):
            endpoint.close()
        self.known.clear()
        self._remote.clear()

    def fall_silent(self) -> None:
        """Note that the process is stopped."""
        self.silent_since = self.kernel.now
        self.domains.fall_silent(self)

    def speak_again(self) -> None:
        """Note that the process runs again."""
        self.silent_since = None
        self.domains.speak_again(self)


class Discovery:
    """The DDS entities that a participant has discovered."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant
        self._news = Condition()
        self._news.set()
        self._writers: list[EndpointInfo] | None = None
        self._readers: list[EndpointInfo] = []

    def note(self) -> None:
        """Note that there are changes."""
        self._writers = None
        self._news.set()

    @property
    def news(self) -> list[Condition]:
        """The conditions that are true while there are unread changes."""
        return [self._news]

    @property
    def gone(self) -> list[Condition]:
        """No conditions: entities that are gone are forgotten at once."""
        return []

    def forget_gone(self) -> None:
        """Do nothing."""

    def refresh(self) -> None:
        """Read all changes: only later ones trigger the condition."""
        self._news.clear()

    def participants(self) -> dict[bytes, str]:
        """Return the GUID and USER_DATA of every participant."""
        found = [self._participant, *self._participant.known]
        return {each.gid: each.user_data for each in found}

    def writers(self) -> list[EndpointInfo]:
        """Return every writer."""
        return self._all()[0]

    def readers(self) -> list[EndpointInfo]:
        """Return every reader."""
        return self._all()[1]

    def _all(self) -> tuple[list[EndpointInfo], list[EndpointInfo]]:
        if self._writers is None:
            known = [self._participant.endpoints, *self._participant.known.values()]
            everyone = list(itertools.chain.from_iterable(each.values() for each in known))
            self._writers = [each.info for each in everyone if isinstance(each, Writer)]
            self._readers = [each.info for each in everyone if isinstance(each, Reader)]
        return self._writers, self._readers
