"""A page server without an arm, and clients of it."""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import ssl
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from websockets.client import ClientProtocol
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin
from websockets.uri import parse_uri

from deploy.operator import hold
from deploy.operator.page import address, server
from deploy.operator.page.records import Records
from deploy.operator.page.site import Site
from deploy.operator.page.state import Clock, PageState

TOKEN = "s3cr3t-token"


class Arm:
    def __init__(self, files: Path, tls: ssl.SSLContext | None = None) -> None:
        scheme = "https" if tls else "http"
        self.received: queue.SimpleQueue[server.Event] = queue.SimpleQueue()
        self.failures: list[Exception] = []
        self.state = PageState()
        self.records = files.with_name(f"{files.name}-records")
        listener = address.listen("127.0.0.1", 0)
        self.port = listener.getsockname()[1]
        self.host = f"127.0.0.1:{self.port}"
        self.origin = f"{scheme}://{self.host}"
        self._server = server.PageServer(
            listener,
            Site(TOKEN, ("127.0.0.1", "localhost", "arm.example"), scheme, files),
            Records(self.records, lambda: 1.25),
            welcome={"strikes": 3},
            receive=self.received.put,
            newest=lambda: self.state,
            clock=Clock(hold.monotonic, lambda stamp: 0.0, lambda: 1.25, lambda stamp: 0.0),
            fail=self.failures.append,
            tls=tls,
        )

    def close(self) -> None:
        self._server.close()
        for failure in self.failures:
            raise failure

    def next(self, kind: type | None = None, seconds: float = 5.0) -> Any:
        deadline = time.monotonic() + seconds
        while True:
            event = self.received.get(timeout=max(0.0, deadline - time.monotonic()))
            if kind is None or isinstance(event, kind):
                return event

    def request(self, raw: bytes) -> bytes:
        with socket.create_connection(("127.0.0.1", self.port), timeout=5.0) as client:
            with contextlib.suppress(OSError):
                client.sendall(raw)
            answer = b""
            with contextlib.suppress(ConnectionResetError):
                while part := client.recv(65536):
                    answer += part
            return answer

    def get(self, path: str, method: str = "GET", **headers: str) -> tuple[int, str, bytes]:
        headers = {"Host": self.host} | {name.replace("_", "-"): value for name, value in headers.items()}
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items() if value)
        answer = self.request(f"{method} {path} HTTP/1.1\r\n{lines}\r\n".encode())
        head, _, body = answer.partition(b"\r\n\r\n")
        return int(head.split(b" ")[1]), head.decode(), body

    def connect(self, **options: Any) -> ClientConnection:
        options = {"origin": self.origin, "compression": None, "open_timeout": 5.0} | options
        return connect(f"ws://{self.host}/socket", **options)

    @contextlib.contextmanager
    def page(self) -> Iterator[ClientConnection]:
        with self.connect() as page:
            assert hello(page)["type"] == "welcome"
            yield page


def hello(page: ClientConnection) -> Any:
    """Say hello; return the answer."""
    page.send(json.dumps({"type": "hello", "token": TOKEN}))
    return message(page)


def message(page: ClientConnection) -> Any:
    return json.loads(page.recv(timeout=5.0))


def update(page: ClientConnection) -> Any:
    while (found := message(page))["type"] != "update":
        pass
    return found


def close_code(page: ClientConnection) -> int:
    closed = end(page)
    assert closed.rcvd, "the server has not said why"
    return closed.rcvd.code


def end(page: ClientConnection) -> ConnectionClosed:
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        try:
            page.recv(timeout=5.0)
        except ConnectionClosed as closed:
            return closed
    raise AssertionError("the connection stays open")


class SleepyPage:
    """A page that reads, and answers pings, only when the test asks for it."""

    def __init__(self, arm: Arm, tls: ssl.SSLContext | None = None) -> None:
        self._socket = socket.create_connection(("127.0.0.1", arm.port), timeout=5.0)
        if tls is not None:
            self._socket = tls.wrap_socket(self._socket, server_hostname="127.0.0.1")
        self._protocol = ClientProtocol(parse_uri(f"ws://{arm.host}/socket"), origin=Origin(arm.origin))
        self._protocol.send_request(self._protocol.connect())
        self._send()
        while self._protocol.state is not State.OPEN:
            self._protocol.receive_data(self._socket.recv(65536))
            self._protocol.events_received()
            if self._protocol.handshake_exc:
                self._socket.close()
                raise self._protocol.handshake_exc
        self._protocol.send_text(json.dumps({"type": "hello", "token": TOKEN}).encode())
        self._send()
        self._socket.settimeout(0.2)

    def wake(self, seconds: float) -> list[Any]:
        """Read for some time; the messages."""
        messages, deadline = [], time.monotonic() + seconds
        while time.monotonic() < deadline:
            with contextlib.suppress(TimeoutError):
                self._protocol.receive_data(self._socket.recv(65536))
            frames = [event for event in self._protocol.events_received() if isinstance(event, Frame)]
            messages += [json.loads(frame.data) for frame in frames if frame.opcode is Opcode.TEXT]
            self._send()
        return messages

    def close(self) -> None:
        self._socket.close()

    def _send(self) -> None:
        for data in self._protocol.data_to_send():
            self._socket.sendall(data)


class Hand:
    """A page whose button a thread holds, without the safeguards of the real page."""

    def __init__(self, line: str, tls: ssl.SSLContext | None = None) -> None:
        """:param line: the line that shows the address of the page."""
        origin, _, token = line.removeprefix("The page: ").partition("/#")
        self.shown: dict[str, Any] = {}
        self.is_connected = True
        self._lock = threading.Lock()
        self._nonce = ""
        self._holds = False
        self._connection = connect(
            f"{origin.replace('http', 'ws', 1)}/socket",
            origin=Origin(origin),
            compression=None,
            ssl=tls,
        )
        self._connection.__enter__()
        self._connection.send(json.dumps({"type": "hello", "token": token}))
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._read, self._beat)]
        for thread in self._threads:
            thread.start()

    def say(self, kind: str, **fields: Any) -> None:
        self._connection.send(json.dumps({"type": kind, **fields}))

    def press(self) -> None:
        with self._lock:
            self.say("press", nonce=self._nonce)
            self._holds = True

    def close(self) -> None:
        self._holds = False
        self._connection.close_socket()
        for thread in self._threads:
            thread.join()

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                message = json.loads(self._connection.recv())
                if message["type"] == "update":
                    self._nonce = message["nonce"]
                    self.shown |= message
        self.is_connected = False

    def _beat(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while self.is_connected:
                with self._lock:
                    if self._holds:
                        self.say("beat", nonce=self._nonce)
                time.sleep(0.05)
