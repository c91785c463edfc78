"""The simulated network: its delays and losses, and discovery.

It follows DDS and RTPS as Cyclone DDS implements them, in what a program can notice: a volatile sample that
is sent before the match is lost; a reliable writer sends again, and keeps at most what its history allows;
samples of one writer arrive in order; participants that fall silent are forgotten after their lease.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from rclpy._dds import Sample
from rclpy_simulation.host import SECOND, Host
from rclpy_simulation.kernel import Kernel

if TYPE_CHECKING:
    from rclpy_simulation.endpoints import Writer
    from rclpy_simulation.participant import Participant

_Z99 = 2.326  # standard normal distribution: 99 % are below


@dataclass(frozen=True)
class Delay:
    """A random duration [s] with a log-normal distribution."""

    median: float
    p99: float
    _sigma: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        sigma = math.log(self.p99 / self.median) / _Z99 if self.p99 > self.median else 0.0
        object.__setattr__(self, "_sigma", sigma)

    def draw(self, kernel: Kernel) -> int:
        """Return a duration [ns]."""
        if not self._sigma:
            return int(self.median * SECOND)
        return int(self.median * kernel.random.lognormvariate(0.0, self._sigma) * SECOND)


LATENCY = Delay(0.0003, 0.003)
DISCOVERY = Delay(0.03, 0.12)
MATCHING = Delay(0.002, 0.02)
RETRANSMISSION = Delay(0.01, 0.1)


@dataclass
class Network:
    """How the network behaves. All values may change while the simulation runs."""

    latency: Delay = LATENCY
    """From a writer to a reader, with the time until the reader's process is scheduled."""
    discovery: Delay = DISCOVERY
    """From the start of a participant until another one knows it."""
    matching: Delay = MATCHING
    """From the creation or deletion of an endpoint until another participant knows of it."""
    loss: float = 0.0
    """Part of the packets between processes that is lost, from 0 up to, but not including, 1."""
    retransmission: Delay = RETRANSMISSION
    """By which a lost sample of a reliable writer is late."""
    lease: float = 10.0
    """Time after which a silent participant is forgotten [s]."""
    announcement: float = 8.0
    """Period at which a participant announces itself, so forgotten ones meet again [s]."""
    held: dict[str, int] = field(default_factory=dict)
    """DDS topics whose samples wait, with the time until when [ns]."""
    cuts: dict[frozenset[str], int] = field(default_factory=dict)
    """Pairs of hosts between which no packet passes, with the time since when [ns]."""

    def is_cut(self, one: Host, other: Host) -> bool:
        """Return whether a partition separates two hosts."""
        return frozenset((one.name, other.name)) in self.cuts


class Domains:
    """Discovery between the participants of all DDS domains."""

    def __init__(self, kernel: Kernel, network: Network) -> None:
        self.kernel = kernel
        self.network = network
        self.participants: dict[Participant, None] = {}  # in the order of their creation
        self.taps: list[Callable[[Writer, Sample], None]] = []
        """Are called with every sample that is written."""

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
        """Tell the participants that know this one about its endpoints."""
        participant.version += 1
        for other in self.participants:
            if participant in other.known:
                self._tell(other, participant)

    def _tell(self, listener: Participant, speaker: Participant) -> None:
        endpoints = tuple(speaker.endpoints.values())
        news = partial(listener.learn, endpoints=endpoints, version=speaker.version)
        self._later(self.network.matching, listener, speaker, news)

    def leave(self, participant: Participant) -> None:
        """Remove a participant that says goodbye. Those that do not hear it find out when its lease ends."""

        def tell(other: Participant) -> None:
            self._later(self.network.matching, other, participant, other.forget)
            self._expire(other, participant, lambda: True)

        self._remove(participant, tell)

    def vanish(self, participant: Participant) -> None:
        """Remove a participant that was killed; the others find out when its lease ends."""
        self._remove(participant, lambda other: self._expire(other, participant, lambda: True))

    def _remove(self, participant: Participant, tell: Callable[[Participant], None]) -> None:
        if participant in self.participants:
            del self.participants[participant]
            for other in self.participants:
                if participant in other.known:
                    tell(other)

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
        """Yield the pairs of participants of one domain on both hosts."""
        members = [each for each in self.participants if each.host.name in pair]
        for one, other in itertools.combinations(members, 2):
            if one.host is not other.host and one.domain_id == other.domain_id:
                yield one, other
