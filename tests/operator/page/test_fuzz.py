"""Random requests and frames on real sockets: no crash, no leak, no movement."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import queue
import random
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from deploy.operator import hold
from deploy.operator.page import connection, server
from tests.operator.page.clients import TOKEN, Arm

SEED = os.environ.get("FUZZ_SEED") or str(time.time_ns())
HARMLESS = {server.Violation, server.Opened, server.Closed, hold.Release}


@pytest.fixture
def arm(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> Iterator[Arm]:
    (tmp_path / "index.html").write_text("")
    arm = Arm(tmp_path)
    yield arm
    arm.close()
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING], f"FUZZ_SEED={SEED}"


def received(arm: Arm) -> list[server.Event]:
    events = []
    with contextlib.suppress(queue.Empty):
        while True:
            events.append(arm.received.get_nowait())
    return events


def request(chance: random.Random, host: str, origin: str) -> bytes:
    lines = [
        chance.choice([b"GET", b"POST", b"get", b"", chance.randbytes(3)])
        + b" "
        + chance.choice([b"/", b"/socket", b"/static/../x", b"/" + chance.randbytes(9), b"", b"/" * 9000])
        + b" "
        + chance.choice([b"HTTP/1.1", b"HTTP/1.0", b"HTTP/2", b"", chance.randbytes(4)]),
        b"Host: " + chance.choice([host.encode(), b"evil.example", b"", chance.randbytes(5)]),
    ]
    for _ in range(chance.randrange(8)):
        lines.append(
            chance.choice(
                [
                    b"Origin: " + origin.encode(),
                    b"Origin: null",
                    b"Upgrade: websocket",
                    b"Connection: Upgrade",
                    b"Sec-WebSocket-Version: 13",
                    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
                    b"Sec-WebSocket-Extensions: permessage-deflate",
                    b"Content-Length: 99999999999999999999",
                    b"Transfer-Encoding: chunked",
                    b"X: " + chance.randbytes(30),
                    chance.randbytes(30),
                    b"X: " + b"y" * 9000,
                ]
            )
        )
    text = b"\r\n".join(lines) + b"\r\n\r\n" + chance.randbytes(chance.randrange(30))
    return text[: chance.randrange(len(text))] if chance.random() < 0.2 else text


def frame(chance: random.Random) -> bytes:
    first = chance.choice([0x81, 0x81, 0x82, 0x88, 0x89, 0x8A, 0x01, 0x00, chance.randrange(256)])
    body = chance.randbytes(chance.randrange(60))
    size = chance.choice([len(body), len(body), len(body) + 1, 126, 127])
    length = bytes([0x80 | min(size, 127)])
    if size >= 126:
        length += chance.choice([b"", struct.pack("!H", 2000), struct.pack("!Q", 1 << 62)])
    return bytes([first]) + length + chance.randbytes(4) + body


def test_random_requests_do_nothing(arm: Arm) -> None:
    chance = random.Random(SEED)
    blocks = 0
    for number in range(2000):
        if number == 500:
            time.sleep(0.1)
            blocks = sys.getallocatedblocks()
        client = socket.create_connection(("127.0.0.1", arm.port), timeout=5.0)
        with client, contextlib.suppress(OSError):
            client.sendall(request(chance, arm.host, arm.origin))
            if chance.random() < 0.5:
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # a reset
            else:
                client.settimeout(0.02)
                client.recv(4096)
    kinds = {type(event) for event in received(arm)}
    assert kinds == {server.Violation}, f"FUZZ_SEED={SEED}"
    assert_calm(arm, blocks)


def test_random_frames_do_nothing(arm: Arm) -> None:
    chance = random.Random(SEED)
    blocks = 0
    for number in range(600):
        if number == 100:
            time.sleep(0.1)
            blocks = sys.getallocatedblocks()
        with contextlib.suppress(ConnectionClosed, OSError), arm.connect(close_timeout=0.1) as page:
            if chance.random() < 0.5:
                page.send(json.dumps({"type": "hello", "token": TOKEN}))
            page.socket.sendall(b"".join(frame(chance) for _ in range(20)))
            page.socket.settimeout(0.1)
    kinds = {type(event) for event in received(arm)}
    assert server.Opened in kinds
    assert kinds <= HARMLESS, f"FUZZ_SEED={SEED}"
    assert_calm(arm, blocks)


def assert_calm(arm: Arm, blocks: int) -> None:
    """The server still serves, and has no more threads and memory than before."""
    deadline = time.monotonic() + connection.REQUEST_TIMEOUT + 3.0
    while sum(thread.name == "page" for thread in threading.enumerate()) > 1:
        assert time.monotonic() < deadline, f"FUZZ_SEED={SEED}: threads stay"
        time.sleep(0.05)
    assert arm.get("/")[0] == 200
    assert sys.getallocatedblocks() < blocks + 20_000, f"FUZZ_SEED={SEED}: memory leaks"
