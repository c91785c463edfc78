"""Simulated writers and readers of DDS."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from rclpy_ground import interface as qos
from rclpy_ground.interface import INFINITY, Sample
from rclpy_ground.interface import Endpoint as EndpointInfo
from rclpy_simulation.conditions import Condition
from rclpy_simulation.host import SECOND
from rclpy_simulation.kernel import Kernel
from rclpy_simulation.link import Link, Place, Sender
from rclpy_simulation.network import Network
from rclpy_simulation.process import running
from rclpy_simulation.statuses import Statuses
from rclpy_simulation.watchdog import Watchdog

# The identifiers of DDS policies (DDS 1.4, 2.3.3).
_DURABILITY, _DEADLINE, _LIVELINESS, _RELIABILITY = 2, 4, 8, 11


class Owner(Place, Protocol):
    """The participant of an endpoint, as the endpoint sees it."""

    gid: bytes
    kernel: Kernel
    network: Network
    taps: list[Callable[[Writer, Sample], None]]

    def next_gid(self, kind: int) -> bytes: ...

    def remove(self, endpoint: Endpoint) -> None: ...


class Endpoint:
    matched_status = ""
    incompatible_status = ""

    def __init__(
        self, participant: Owner, topic: str, type_name: str, profile: QoSProfile, user_data: str
    ) -> None:
        qos.check(profile)
        self.participant = participant
        self.topic = topic
        self.type_name = type_name
        self.profile = profile
        self.user_data = user_data
        self.logger_name = ""  # of the node that it belongs to
        self.gid = participant.next_gid(0x03 if isinstance(self, Writer) else 0x04)
        self.instance_handle = participant.kernel.next_number()
        self.is_closed = False
        self.is_reliable = profile.reliability != ReliabilityPolicy.BEST_EFFORT
        self.is_latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self.depth = None if profile.history == HistoryPolicy.KEEP_ALL else profile.depth or 1
        self.lifespan = qos.nanoseconds(profile.lifespan)
        self.lease = qos.nanoseconds(profile.liveliness_lease_duration)
        self.is_manual = profile.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
        self.info = EndpointInfo(self.gid, participant.gid, topic, type_name, user_data, _announced(profile))
        self.statuses = Statuses()
        self.handle = self.statuses.handle
        self.watch = self.statuses.watch
        self.watch_also = self.statuses.watch_also
        self.changed = self.statuses.changed

    def match(self, other: Endpoint) -> None:
        """Match an endpoint of another participant, or of this one, if it fits."""
        writer, reader = (self, other) if isinstance(self, Writer) else (other, self)
        if not isinstance(writer, Writer) or not isinstance(reader, Reader):
            return
        if writer.topic != reader.topic or writer.type_name != reader.type_name:
            return
        if policy := _conflict(writer.profile, reader.profile):
            self.statuses.change(self.incompatible_status, total_count=1, last_policy_id=policy)
            return
        self._connect(other, writer.link_to(reader))
        self.statuses.change(
            self.matched_status,
            total_count=1,
            current_count=1,
            last_instance_handle=other.instance_handle,
        )

    def unmatch(self, other: Endpoint) -> None:
        if self._disconnect(other):
            self.statuses.change(
                self.matched_status, current_count=-1, last_instance_handle=other.instance_handle
            )

    def _watch_deadline(self, status: str, is_over: Callable[[], bool]) -> Watchdog | None:
        """Return what notices missed deadlines, from the first sample on; ``None`` without a deadline."""
        period = qos.nanoseconds(self.profile.deadline)

        def miss(periods: int) -> bool:
            if self.is_closed or is_over():
                return False
            self.statuses.change(status, total_count=periods)
            return True

        return Watchdog(self.participant.process, period, miss) if period < INFINITY else None

    def _connect(self, other: Any, link: Link) -> None:
        raise NotImplementedError

    def _disconnect(self, other: Any) -> bool:
        raise NotImplementedError

    def close(self) -> None:
        if not self.is_closed:
            self.is_closed = True
            self.handle.close()
            self.participant.remove(self)


class Writer(Endpoint):
    matched_status = "publication_matched"
    incompatible_status = "offered_incompatible_qos"

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._links: dict[Reader, Link] = {}  # all that either side knows of
        self._matched: dict[Reader, Link] = {}
        self._history: deque[tuple[int, Sample]] = deque(maxlen=self.depth)
        self.sent = 0  # samples
        self.is_alive = True
        self._watchdogs: list[Watchdog] = []
        if deadline := self._watch_deadline("offered_deadline_missed", lambda: False):
            self._watchdogs.append(deadline)
        self._lease: Watchdog | None = None
        if self.is_manual and self.lease < INFINITY:
            self._lease = Watchdog(self.participant.process, self.lease, self._lose_liveliness)
            self._lease.renew()
            self._watchdogs.append(self._lease)

    def write(self, data: bytes, *, is_request: bool = False) -> None:
        data = bytes(data)
        participant = self.participant
        if self.is_closed:
            raise InvalidHandle("cannot use a writer that was destroyed")
        if len(data) < 4:
            raise ValueError(f"invalid CDR of {len(data)} octets: it needs an encapsulation header and data")
        process = participant.process
        if process.steps_left:
            process.step()
        if process.ended:
            return
        if len(data) & 3:
            data += bytes(-len(data) & 3)
        now = participant.kernel.now
        sample = Sample(data, process.host.time_of_day(now), self.instance_handle)
        if taps := participant.taps:
            for tap in taps:
                tap(self, sample)
            if process.ended or process.is_suspended or process.interrupts:  # by a tap
                process.settle()
        self.sent += 1
        if self.is_latched:
            self._history.append((now + self.lifespan, sample))
        if self._watchdogs:
            self._show_life()
        for link in self._matched.values():
            link.send(sample)

    def link_to(self, reader: Reader) -> Link:
        link = self._links.get(reader)
        if link is None:
            place = self.participant
            link = self._links[reader] = Link(place.kernel, place.network, self, reader)
            reader.replace_link(self, link)
        return link

    def _connect(self, other: Reader, link: Link) -> None:
        self._matched[other] = link
        if other.is_latched and other.is_reliable:  # Cyclone DDS sends no history to best-effort readers
            now = self.participant.kernel.now
            for expiry, sample in self._history:
                if expiry > now:
                    link.send(sample)

    def _disconnect(self, other: Reader) -> bool:
        self._links.pop(other, None)
        return self._matched.pop(other, None) is not None

    def matched(self) -> int:
        return len(self._matched)

    def matched_user_data(self) -> list[str]:
        return [reader.user_data for reader in self._matched]

    def links_to(self, participant: Place) -> list[Link]:
        """Return the links to the readers of a participant."""
        return [link for reader, link in self._matched.items() if reader.participant is participant]

    def wait_for_acks(self, timeout: int) -> bool:
        thread = running()
        deadline = self.participant.kernel.now + timeout
        while any(link.is_unacknowledged for link in self._matched.values()):
            if self.participant.kernel.now >= deadline:
                return False
            thread.wait(min(deadline, self.participant.kernel.now + SECOND // 1000))
        return True

    def assert_liveliness(self) -> None:
        if self._lease is not None:
            self._lease.renew()
            self._revive()
            for link in self._matched.values():
                link.assert_liveliness()

    def _show_life(self) -> None:
        for watchdog in self._watchdogs:
            watchdog.renew()
        self._revive()

    def _revive(self) -> None:
        if not self.is_alive:
            self.is_alive = True
            self._tell_local_readers()

    def _lose_liveliness(self, periods: int) -> bool:
        if not self.is_closed:
            self.is_alive = False
            self.statuses.change("liveliness_lost", total_count=1)
            self._tell_local_readers()
        return False

    def _tell_local_readers(self) -> None:
        for link in self._matched.values():
            if link.is_local:
                link.set_alive(self.is_alive)

    def unlink(self, reader: Reader) -> None:
        """Forget the link to a reader that was closed before this writer's participant knew it."""
        if reader not in self._matched:
            self._links.pop(reader, None)


class Reader(Endpoint):
    matched_status = "subscription_matched"
    incompatible_status = "requested_incompatible_qos"

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.condition = Condition()
        self._writers: dict[Writer, Link] = {}
        self._queue: deque[tuple[int, Sample]] = deque(maxlen=self.depth)
        self._deadline = self._watch_deadline(
            "requested_deadline_missed", lambda: not self._queue and not self._writers
        )

    def receive(self, sample: Sample, lifespan: int) -> None:
        """Keep a sample that has arrived, for its lifespan [ns]; it counts from now, as in Cyclone DDS."""
        if not self.is_closed:
            if self._deadline is not None:
                self._deadline.renew()
            self._queue.append((self.participant.kernel.now + lifespan, sample))
            self.condition.set()

    def take(self) -> Sample | None:
        process = self.participant.process
        if process.steps_left:
            process.step()
        now = self.participant.kernel.now
        while self._queue:
            expiry, sample = self._queue.popleft()
            if expiry > now:
                break
        else:
            sample = None
        if not self._queue:
            self.condition.clear()
        return sample

    def _connect(self, other: Writer, link: Link) -> None:
        self._writers[other] = link
        link.connect_reader()
        self._change_liveliness(other, link.is_alive, 1)

    def _disconnect(self, other: Writer) -> bool:
        link = self._writers.pop(other, None)
        if link is not None:
            link.disconnect_reader()
            self._change_liveliness(other, link.is_alive, -1)
        return link is not None

    def replace_link(self, writer: Writer, link: Link) -> None:
        """Receive by another link from a writer that had forgotten this reader, but was not forgotten."""
        if writer in self._writers:
            self._writers[writer].disconnect_reader()
            self._writers[writer] = link
            link.connect_reader()

    def note_liveliness(self, writer: Sender, is_alive: bool) -> None:
        """Note that a matched writer has lost its liveliness, or has got it again."""
        self._change_liveliness(writer, not is_alive, -1)
        self._change_liveliness(writer, is_alive, 1)

    def _change_liveliness(self, writer: Sender, is_alive: bool, change: int) -> None:
        count = "alive_count" if is_alive else "not_alive_count"
        self.statuses.change(
            "liveliness_changed", **{count: change}, last_instance_handle=writer.instance_handle
        )

    def links_from(self, participant: Place) -> Iterator[Link]:
        """Yield the links from the writers of a participant."""
        for writer, link in self._writers.items():
            if writer.participant is participant:
                yield link

    def close(self) -> None:
        self.condition.close()
        super().close()
        for writer in self._writers:
            writer.unlink(self)

    def matched(self) -> int:
        return len(self._writers)

    def matched_user_data(self) -> list[str]:
        return [writer.user_data for writer in self._writers]

    def user_data_of(self, publication_handle: int) -> str | None:
        return next((w.user_data for w in self._writers if w.instance_handle == publication_handle), None)


def _conflict(writer: QoSProfile, reader: QoSProfile) -> int:
    """Return the policy that keeps an offer from matching a request; 0 if none does (DDS 1.4, 2.2.3)."""
    best_effort, latched = ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.TRANSIENT_LOCAL
    if writer.reliability == best_effort and reader.reliability != best_effort:
        return _RELIABILITY
    if reader.durability == latched and writer.durability != latched:
        return _DURABILITY
    if qos.nanoseconds(writer.deadline) > qos.nanoseconds(reader.deadline):
        return _DEADLINE
    manual = LivelinessPolicy.MANUAL_BY_TOPIC
    if reader.liveliness == manual and writer.liveliness != manual:
        return _LIVELINESS
    leases = [qos.nanoseconds(each.liveliness_lease_duration) for each in (writer, reader)]
    return _LIVELINESS if leases[0] > leases[1] else 0


def _announced(profile: QoSProfile) -> QoSProfile:
    """Return the policies that discovery announces: none is left to a default."""
    best_effort = profile.reliability == ReliabilityPolicy.BEST_EFFORT
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    manual = profile.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
    keep_all = profile.history == HistoryPolicy.KEEP_ALL
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if keep_all else HistoryPolicy.KEEP_LAST,
        depth=profile.depth,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        lifespan=Duration(nanoseconds=qos.nanoseconds(profile.lifespan)),
        deadline=Duration(nanoseconds=qos.nanoseconds(profile.deadline)),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if manual else LivelinessPolicy.AUTOMATIC,
        liveliness_lease_duration=Duration(nanoseconds=qos.nanoseconds(profile.liveliness_lease_duration)),
    )
