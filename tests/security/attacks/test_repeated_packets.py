"""What packets do that are recorded and sent again; the rows of A2 in deploy/SAFETY.md."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress

import pytest

from tests.security.attacks.conftest import (
    ENGINES,
    HEARTBEAT,
    STATE,
    MakePeer,
    Peer,
    SecureSite,
    hold_switch_and_turn_on,
    until,
)
from tests.system.sites import Site


class Wire:
    """The UDP packets on loopback: recorded, and sent again as they were."""

    def __init__(self) -> None:
        try:
            self._sender = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW)
        except PermissionError:
            pytest.skip("platform: this user may not record packets")
        self.packets: list[tuple[float, bytes]] = []
        """Each with the time since the one before [s]."""

    @contextmanager
    def recording(self, ports: range) -> Iterator[None]:
        """Record meanwhile what is sent to some ports."""
        ended = threading.Event()
        with socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_UDP) as receiver:
            receiver.setsockopt(
                socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22
            )  # bursts come faster than Python reads
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")
            receiver.settimeout(0.05)
            recorder = threading.Thread(target=self._record, args=[receiver, ports, ended])
            recorder.start()
            try:
                yield
            finally:
                ended.set()
                recorder.join()

    def _record(self, receiver: socket.socket, ports: range, ended: threading.Event) -> None:
        before = time.monotonic()
        while not ended.is_set():
            with suppress(TimeoutError):
                packet = receiver.recv(65536)
                at = _udp(packet) + 2
                if int.from_bytes(packet[at : at + 2]) in ports:
                    now = time.monotonic()
                    self.packets.append((now - before, packet))
                    before = now

    def repeat(self) -> None:
        """Send all packets again, at the pace at which they came."""
        for pause, packet in self.packets:
            time.sleep(pause)
            self._sender.sendto(_without_checksum(packet), ("127.0.0.1", 0))

    def close(self) -> None:
        self._sender.close()


def _udp(packet: bytes) -> int:
    """Return where the header of UDP begins, after that of IPv4."""
    return 4 * (packet[0] & 15)


def _without_checksum(packet: bytes) -> bytes:
    """Return a packet of UDP without its checksum, which the kernel does not complete on loopback."""
    at = _udp(packet) + 6
    return packet[:at] + bytes(2) + packet[at + 2 :]


@pytest.fixture
def wire() -> Iterator[Wire]:
    with closing(Wire()) as wire:
        yield wire


Heard = dict[str, list[object]]
"""What a watcher heard, by topic."""


def repeat(wire: Wire, watcher: Peer) -> Heard:
    """Send the recorded packets twice; return what the watcher hears until a second later."""
    heard: Heard = {name: [] for name in (HEARTBEAT, ENGINES, STATE)}

    def listen() -> None:
        for name, values in heard.items():
            values += watcher("heard", name)

    listen()
    for values in heard.values():
        values.clear()
    with ThreadPoolExecutor() as threads:
        for work in (wire.repeat, wire.repeat, lambda: time.sleep(1.0)):
            done = threads.submit(work)
            while not done.done():
                listen()
            done.result()
    return heard


def ports_of(domain: int) -> range:
    """Return the ports of DDS in a domain."""
    return range(7400 + 250 * domain, 7650 + 250 * domain)


def repeat_an_operator(make_peer: MakePeer, watcher: Peer, wire: Wire, domain: int) -> tuple[Heard, Heard]:
    """Record all packets of a domain, from before an operator joins until it has gone, and repeat them.

    Return what the watcher hears again while the operator lives, and after its end.
    """
    for name in (HEARTBEAT, ENGINES):
        watcher("read", name)
    until(lambda: watcher("writers", HEARTBEAT) == 2)  # the virtual switch and the page
    ports = ports_of(domain)
    with wire.recording(ports):
        operator = make_peer("terminal_3", "terminal")
        assert "on" in hold_switch_and_turn_on(operator, watcher, 30.0)
        for _ in range(20):  # an operator's usual packets
            operator("publish", HEARTBEAT, True)
            operator("publish", ENGINES, "turn_on")
            time.sleep(0.05)
        operator("publish", ENGINES, "turn_off")
        until(lambda: watcher("heard", STATE)[-1:] == ["off"])
    alive = repeat(wire, watcher)
    with wire.recording(ports):
        operator.close()
        until(lambda: watcher("writers", HEARTBEAT) == 2)
    return alive, repeat(wire, watcher)


def test_keys_hide_messages_but_no_enclaves_and_permissions(
    secure_site: SecureSite, make_peer: MakePeer, watcher: Peer, wire: Wire
) -> None:
    with wire.recording(ports_of(secure_site.domain)):
        operator = make_peer("terminal_3", "terminal")
        assert "on" in hold_switch_and_turn_on(operator, watcher, 30.0)
        operator("publish", ENGINES, "turn_off")
        until(lambda: watcher("heard", STATE)[-1:] == ["off"])
    recorded = b"".join(packet for _, packet in wire.packets)
    assert b"turn_on" not in recorded
    for shown in (b"/terminal", b"BEGIN CERTIFICATE", b"<allow_rule>", b"rt/engines"):
        assert shown in recorded


def test_repeated_packets_move_nothing(
    secure_site: SecureSite, make_peer: MakePeer, watcher: Peer, wire: Wire
) -> None:
    for heard in repeat_an_operator(make_peer, watcher, wire, secure_site.domain):
        assert set(heard[STATE]) == {"off"}
        assert "turn_on" not in heard[ENGINES]
        assert True not in heard[HEARTBEAT]


def test_repeated_packets_are_heard_without_keys(
    open_site: Site, make_open_peer: MakePeer, open_watcher: Peer, wire: Wire
) -> None:
    """Only the services refuse them there, because a heartbeat and a `turn_on` of that time are old."""
    _, heard = repeat_an_operator(make_open_peer, open_watcher, wire, open_site.domain)
    assert "turn_on" in heard[ENGINES]
    assert True in heard[HEARTBEAT]
