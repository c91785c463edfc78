"""Links: the transport of samples from one writer to one reader."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from rclpy_ground.interface import INFINITY, Sample
from rclpy_simulation.host import Host
from rclpy_simulation.kernel import Kernel
from rclpy_simulation.network import Network
from rclpy_simulation.process import Process, here
from rclpy_simulation.watchdog import Watchdog

_STOPPED_QUEUE = 256  # samples of a best-effort writer that the kernel of a stopped process keeps


class Place(Protocol):
    process: Process
    host: Host


class End(Protocol):
    is_reliable: bool

    @property
    def participant(self) -> Place: ...


class Sender(End, Protocol):
    topic: str
    instance_handle: int
    depth: int | None
    lifespan: int
    lease: int
    sent: int
    is_alive: bool
    is_manual: bool


class Receiver(End, Protocol):
    is_closed: bool

    def receive(self, sample: Sample, lifespan: int) -> None: ...

    def note_liveliness(self, writer: Sender, is_alive: bool) -> None: ...


class Link:
    """The path of samples from one writer to one reader."""

    __slots__ = (
        "_early",
        "_has_lease",
        "_is_unanswered",
        "_last_arrival",
        "_lease",
        "_stopped",
        "_unsent",
        "is_alive",
        "is_local",
        "is_reliable",
        "kernel",
        "network",
        "reader",
        "reader_knows",
        "writer",
    )

    def __init__(self, kernel: Kernel, network: Network, writer: Sender, reader: Receiver) -> None:
        self.kernel = kernel
        self.network = network
        self.writer = writer
        self.reader = reader
        self.is_reliable = writer.is_reliable and reader.is_reliable
        self.is_local = writer.participant.process is reader.participant.process
        self.reader_knows = False  # whether the reader's participant has discovered the writer
        self.is_alive = True  # whether the writer is, as the reader knows
        self._has_lease = writer.lease < INFINITY and not self.is_local
        self._lease: Watchdog | None = None  # of a writer that asserts its liveliness by hand
        self._last_arrival = 0
        self._is_unanswered = False  # a sample was sent to a reader that no longer exists
        depth = writer.depth if self.is_reliable else 0
        self._unsent: deque[Sample] = deque(maxlen=depth)  # until a partition ends
        self._early: deque[Sample] = deque(maxlen=depth)  # until the reader knows the writer
        self._stopped: deque[Sample] | None = None  # since the reader's process has stopped

    def send(self, sample: Sample) -> None:
        kernel, network = self.kernel, self.network
        if self.reader.is_closed:
            self._is_unanswered = True
            return
        if self.is_local:  # Cyclone DDS stores it with the reader, without a network
            self._deliver(sample)
            if here.thread is not None:
                here.thread.note_empty_wait()  # a program that floods itself lets time pass
            return
        if network.cuts and self._is_cut():
            self._unsent.append(sample)
            return
        if network.lost and kernel.now < network.lost.get(self.writer.topic, 0):
            return
        arrival = kernel.now + network.latency.draw(kernel)
        if network.held:
            arrival = max(arrival, network.held.get(self.writer.topic, 0))
        if network.loss and kernel.random.random() < network.loss:
            if self.is_reliable:
                self._send_again(sample, arrival)
            return
        if arrival < self._last_arrival:
            arrival = self._last_arrival
        self._last_arrival = arrival
        kernel.schedule(arrival, lambda: self._arrive(sample))

    def _send_again(self, sample: Sample, arrival: int) -> None:
        """Let a lost sample arrive later, unless the writer's history has no place for it any more."""
        kernel, network, writer = self.kernel, self.network, self.writer
        number = writer.sent
        arrival += network.retransmission.draw(kernel)
        while kernel.random.random() < network.loss:
            arrival += network.retransmission.draw(kernel)
        arrival = self._last_arrival = max(arrival, self._last_arrival)

        def arrive() -> None:
            if writer.depth is None or writer.sent - number < writer.depth:
                self._arrive(sample)

        kernel.schedule(arrival, arrive)

    def _is_cut(self) -> bool:
        return self.network.is_cut(self.writer.participant.host, self.reader.participant.host)

    def _arrive(self, sample: Sample) -> None:
        process = self.reader.participant.process
        if process.is_stopped:
            if self._stopped is None:
                length = self.writer.depth if self.is_reliable else _STOPPED_QUEUE
                self._stopped = deque(maxlen=length)
                process.postpone(self._arrive_after_stop)
            self._stopped.append(sample)
        else:
            self._deliver(sample)

    def _deliver(self, sample: Sample) -> None:
        if self.reader_knows:
            if self._has_lease:
                self._note_life()
            self.reader.receive(sample, self.writer.lifespan)
        else:
            self._early.append(sample)

    def _arrive_after_stop(self) -> None:
        samples, self._stopped = self._stopped or (), None
        for sample in samples:
            self._deliver(sample)

    @property
    def is_unacknowledged(self) -> bool:
        """Whether a reliable reader has not got all samples yet."""
        is_late = bool(self._unsent or self._early or self._stopped) or self._last_arrival > self.kernel.now
        return self.is_reliable and (is_late or self._is_unanswered)

    def release(self) -> None:
        """Send the samples that were held during a partition."""
        held = list(self._unsent)
        self._unsent.clear()
        for sample in held:
            self.send(sample)

    # What the reader knows of the writer

    def connect_reader(self) -> None:
        self.reader_knows = True
        self.is_alive = self.writer.is_alive or not self.is_local
        if self._has_lease and self.writer.is_manual:
            self._lease = Watchdog(self.reader.participant.process, self.writer.lease, self._expire)
            self._lease.renew()
        early = list(self._early)
        self._early.clear()
        for sample in early:
            self._deliver(sample)

    def disconnect_reader(self) -> None:
        self.reader_knows = False
        if self._lease is not None:
            self._lease.stop()
            self._lease = None

    def assert_liveliness(self) -> None:
        """Inform the reader that the writer's application is alive, although it has written nothing."""
        if self._has_lease and not (self.network.cuts and self._is_cut()):
            self.kernel.after(self.network.latency.draw(self.kernel), self._renew)

    def _renew(self) -> None:
        if self._lease is not None and self.is_alive:  # Cyclone DDS revives a writer with a sample only
            self._lease.renew()

    def _note_life(self) -> None:
        if self._lease is not None:
            self._lease.renew()
        if not self.is_alive:
            self.set_alive(True)

    def _expire(self, periods: int) -> bool:
        self.set_alive(False)
        return False

    @property
    def automatic_lease(self) -> int | None:
        """Time of silence after which the reader takes the writer for dead [ns]; ``None`` if it is never."""
        return self.writer.lease if self._has_lease and not self.writer.is_manual else None

    def set_alive(self, is_alive: bool) -> None:
        if self.reader_knows and self.is_alive != is_alive:
            self.is_alive = is_alive
            self.reader.note_liveliness(self.writer, is_alive)
