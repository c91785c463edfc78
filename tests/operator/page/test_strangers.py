"""Connections without the token: however many there are, the operator gets in."""

from __future__ import annotations

import contextlib
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
from websockets.exceptions import ConnectionClosed

from deploy.operator.page import server
from deploy.operator.page.site import STATIC
from tests.operator.page.clients import Arm, close_code, end, update
from tests.operator.page.crowd import FIRST, HELLO

ATTEMPTS = 10


@pytest.fixture
def arm() -> Iterator[Arm]:
    arm = Arm(STATIC)
    yield arm
    arm.close()


@contextlib.contextmanager
def crowd(arm: Arm, count: int, kind: str, *addresses: str) -> Iterator[None]:
    command = [sys.executable, "-m", "tests.operator.page.crowd", str(arm.port), str(count), kind, *addresses]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield
        finally:
            process.kill()


def open_page(arm: Arm) -> None:
    """Open the page as a browser does, without a second attempt."""
    status, _, index = arm.get("/")
    assert status == 200
    for path in re.findall(rb'(?:href|src)="(/static/[^"]+)"', index):
        assert arm.get(path.decode())[0] == 200
    with arm.page() as page:
        update(page)


@pytest.mark.parametrize("kind", FIRST)
@pytest.mark.parametrize("count", [40, 400])
def test_page_opens_in_a_crowd_of_strangers(count: int, kind: str, arm: Arm) -> None:
    with crowd(arm, count, kind):
        for _ in range(ATTEMPTS):
            open_page(arm)


def test_strangers_of_one_address_leave_the_room_of_another(arm: Arm) -> None:
    """A remote operator is slower than a flood: only connections of the same address make room for it."""
    with socket.create_connection(("127.0.0.1", arm.port)) as operator, crowd(arm, 400, "idle", "127.0.0.2"):
        operator.sendall(f"GET / HTTP/1.1\r\nHost: {arm.host}\r\n\r\n".encode())
        assert operator.recv(12) == b"HTTP/1.1 200"


def test_operator_with_more_connections_than_each_stranger_gets_in(arm: Arm) -> None:
    addresses = [f"127.0.0.{number}" for number in range(2, 202)]
    with crowd(arm, 200, "idle", *addresses), contextlib.ExitStack() as stack:
        browser = [stack.enter_context(socket.create_connection(("127.0.0.1", arm.port))) for _ in range(6)]
        for each in browser:
            each.sendall(f"GET / HTTP/1.1\r\nHost: {arm.host}\r\n\r\n".encode())
        assert [each.recv(12) for each in browser] == 6 * [b"HTTP/1.1 200"]


@pytest.mark.timed
def test_page_that_is_open_keeps_its_updates_in_a_crowd(arm: Arm) -> None:
    with arm.page() as page, crowd(arm, 400, "guessing"):
        gaps, last = [], time.monotonic()
        for _ in range(100):
            update(page)
            now = time.monotonic()
            gaps.append(now - last)
            last = now
    assert max(gaps) < 1.0


def test_strangers_have_a_short_life(arm: Arm) -> None:
    ends = {}
    for kind in ("idle", "half", "silent"):
        with socket.create_connection(("127.0.0.1", arm.port), timeout=10.0) as stranger:
            began = time.monotonic()
            stranger.sendall(FIRST[kind].format(port=arm.port).encode())
            with contextlib.suppress(ConnectionResetError):
                while stranger.recv(65536):
                    pass
            ends[kind] = time.monotonic() - began
    assert max(ends.values()) < 4.0, ends


def test_slow_request_does_not_prolong_its_life(arm: Arm) -> None:
    with socket.create_connection(("127.0.0.1", arm.port), timeout=0.05) as stranger:
        began = time.monotonic()
        stranger.sendall(FIRST["slow"].encode())
        with contextlib.suppress(ConnectionError):
            while time.monotonic() - began < 20.0:
                with contextlib.suppress(TimeoutError):
                    if not stranger.recv(1):
                        break
                stranger.sendall(b"x")
    assert time.monotonic() - began < 4.0


def test_long_request_is_closed(arm: Arm) -> None:
    head = f"GET / HTTP/1.1\r\nHost: {arm.host}\r\n".encode() + 50 * (b"X: " + 1000 * b"y" + b"\r\n")
    assert arm.request(head + b"\r\n") == b""
    assert arm.next(server.Violation).reason == "a request is longer than 16384 bytes"


def test_stranger_that_sends_pings_is_closed(arm: Arm) -> None:
    with arm.connect() as page:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(20):
                page.ping()
        assert close_code(page) == 4429
    assert arm.next(server.Violation).reason == "a connection sends too many frames"


def test_stranger_that_is_too_many_makes_the_oldest_leave(arm: Arm) -> None:
    with contextlib.ExitStack() as stack:
        strangers = [
            stack.enter_context(socket.create_connection(("127.0.0.1", arm.port), timeout=5.0))
            for _ in range(server.MAX_STRANGERS + 1)
        ]
        assert strangers[0].recv(1) == b""
        strangers[-1].sendall(f"GET / HTTP/1.1\r\nHost: {arm.host}\r\n\r\n".encode())
        assert strangers[-1].recv(12) == b"HTTP/1.1 200"
    assert arm.next(server.Violation).reason == "too many connections"


def test_flood_of_violations_is_reported_a_few_times_a_second(arm: Arm) -> None:
    began = time.monotonic()
    for _ in range(200):
        with arm.connect() as page:
            page.send(HELLO.decode())
            end(page)
    seconds = time.monotonic() - began
    reports, times = 0, 0
    while times < 200:
        violation = arm.next(server.Violation)
        assert violation.reason == "a page has a wrong token"
        reports, times = reports + 1, times + violation.times
    assert times == 200
    assert reports <= seconds / server.UPDATE_PERIOD + 2
