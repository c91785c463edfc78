"""Simulated participants of DDS, and how they discover each other."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from functools import partial

from rclpy.qos import QoSProfile

from rclpy_ground.interface import Sample
from rclpy_simulation.discovery import Discovery
from rclpy_simulation.endpoints import Endpoint, Reader, Writer
from rclpy_simulation.host import SECOND
from rclpy_simulation.kernel import Kernel
from rclpy_simulation.link import Link
from rclpy_simulation.network import Delay, Network
from rclpy_simulation.process import running_process


class Participant:
    """A simulated participant of the process that creates it."""

    def __init__(self, domains: Domains, domain_id: int, enclave: str) -> None:
        process = running_process()
        self.domain_id = domain_id
        self.user_data = f"enclave={enclave};"
        self.process = process
        self.host = process.host
        self.kernel = process.kernel
        self.domains = domains
        self.network = domains.network
        self.taps = domains.taps
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
        writer = Writer(self, topic, type_name, profile, user_data)
        self._add(writer)
        return writer

    def create_reader(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Reader:
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
        if self.endpoints.pop(endpoint.gid, None) is not None:
            local = self._local[endpoint.topic]
            local.remove(endpoint)
            for other in local:
                other.unmatch(endpoint)
            self._announce()

    def _announce(self) -> None:
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
        if self._discovery is None:
            self._discovery = Discovery(self._participants, self._everyone)
        return self._discovery

    def _participants(self) -> dict[bytes, str]:
        return {each.gid: each.user_data for each in (self, *self.known)}

    def _everyone(self) -> Iterator[Endpoint]:
        everyone = (self.endpoints, *self.known.values())
        return itertools.chain.from_iterable(endpoints.values() for endpoints in everyone)

    def _note_news(self) -> None:
        if self._discovery is not None:
            self._discovery.note()

    # Its end

    def close(self) -> None:
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
        self.silent_since = self.kernel.now
        self.domains.fall_silent(self)

    def speak_again(self) -> None:
        self.silent_since = None
        self.domains.speak_again(self)


class Domains:
    """Discovery between the participants of all DDS domains."""

    def __init__(self, kernel: Kernel, network: Network) -> None:
        self.kernel = kernel
        self.network = network
        self.participants: dict[Participant, None] = {}  # in the order of their creation
        self.taps: list[Callable[[Writer, Sample], None]] = []
        """Are called with every sample that is written."""
        self.version = 0
        """Of all endpoints: another one after each change."""

    def create_participant(self, domain_id: int, enclave: str) -> Participant:
        return Participant(self, domain_id, enclave)

    def join(self, participant: Participant) -> None:
        """Let a new participant and the others of its domain discover each other."""
        for other in self.participants:
            if other.domain_id == participant.domain_id:
                self._introduce(participant, other)
        self.participants[participant] = None

    def _introduce(self, one: Participant, other: Participant) -> None:
        for listener, speaker in ((one, other), (other, one)):
            self._later(self.network.discovery, listener, speaker, listener.discover)

    def _later(
        self, delay: Delay, listener: Participant, speaker: Participant, action: Callable[[Participant], None]
    ) -> None:
        """Let a participant hear of another one after a delay, unless the network is cut."""
        if listener.process is speaker.process:  # Cyclone DDS needs no messages within a process
            action(speaker)
            return

        def hear() -> None:
            if self.network.is_cut(listener.host, speaker.host) or listener.has_left:
                return
            for process in (listener.process, speaker.process):
                if process.is_stopped:
                    process.postpone(hear)
                    return
            action(speaker)

        duration = delay.draw(self.kernel)
        while self.network.loss and self.kernel.random.random() < self.network.loss:
            duration += self.network.retransmission.draw(self.kernel)
        self.kernel.after(duration, hear)

    def announce(self, participant: Participant) -> None:
        """Inform the participants that know this one of its endpoints."""
        participant.version += 1
        self.version += 1
        for other in self.participants:
            if participant in other.known:
                self._tell(other, participant)

    def _tell(self, listener: Participant, speaker: Participant) -> None:
        endpoints = tuple(speaker.endpoints.values())
        news = partial(listener.learn, endpoints=endpoints, version=speaker.version)
        self._later(self.network.matching, listener, speaker, news)

    def leave(self, participant: Participant) -> None:
        """Remove a participant that says goodbye. Those that do not hear it find out when its lease ends."""

        def inform(other: Participant) -> None:
            self._later(self.network.matching, other, participant, other.forget)
            self._expire(other, participant, lambda: True)

        self._remove(participant, inform)

    def vanish(self, participant: Participant) -> None:
        """Remove a participant that was killed; the others find out when its lease ends."""
        self._remove(participant, lambda other: self._expire(other, participant, lambda: True))

    def _remove(self, participant: Participant, inform: Callable[[Participant], None]) -> None:
        if participant in self.participants:
            del self.participants[participant]
            for other in self.participants:
                if participant in other.known:
                    inform(other)

    def fall_silent(self, participant: Participant) -> None:
        """Let the others forget a participant whose process is stopped for longer than its lease."""
        since = self.kernel.now
        for other in self.participants:
            if participant in other.known:
                self._expire(other, participant, lambda: participant.silent_since == since)

    def speak_again(self, participant: Participant) -> None:
        """Let a participant whose process runs again meet those that have forgotten it."""
        for other in self.participants:
            if other is not participant and other.domain_id == participant.domain_id:
                self._meet_again(participant, other)

    def _expire(self, one: Participant, other: Participant, is_silent: Callable[[], bool]) -> None:
        """Let a participant forget another one after its lease, if that is still silent."""
        if one.process is other.process:
            return
        for link in one.links_from(other):
            if (lease := link.automatic_lease) is not None:
                self.kernel.after(lease, lambda it=link: it.set_alive(False) if is_silent() else None)  # type: ignore[misc]
        self.kernel.after(
            int(self.network.lease * SECOND), lambda: one.forget(other) if is_silent() else None
        )

    def _meet_again(self, one: Participant, other: Participant) -> None:
        """Let participants meet again with the next announcement, if one has forgotten the other."""
        if other not in one.known or one not in other.known:
            announcement = int(self.kernel.random.uniform(0.0, self.network.announcement) * SECOND)
            self.kernel.after(announcement, lambda: self._introduce(one, other))

    def cut(self, one: str, other: str) -> None:
        """Let no packet pass between two hosts."""
        pair = frozenset((one, other))
        since = self.network.cuts.setdefault(pair, self.kernel.now)
        for first, second in self._across(pair):
            for listener, speaker in ((first, second), (second, first)):
                self._expire(listener, speaker, lambda: self.network.cuts.get(pair) == since)

    def heal(self, one: str, other: str) -> None:
        """Let packets pass between two hosts again."""
        pair = frozenset((one, other))
        self.network.cuts.pop(pair, None)
        for first, second in self._across(pair):
            for link in (*first.links_to(second), *second.links_to(first)):
                link.release()
            for listener, speaker in ((first, second), (second, first)):
                if speaker in listener.known:  # what it said during the partition
                    self._tell(listener, speaker)
            self._meet_again(first, second)

    def _across(self, pair: frozenset[str]) -> Iterator[tuple[Participant, Participant]]:
        members = [each for each in self.participants if each.host.name in pair]
        for one, other in itertools.combinations(members, 2):
            if one.host is not other.host and one.domain_id == other.domain_id:
                yield one, other
