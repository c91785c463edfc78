"""One client of the web server: HTTP up to the answer to its request, then a WebSocket. It never blocks."""

from __future__ import annotations

import ipaddress
import math
import selectors
import socket
import ssl
from collections.abc import Callable

from websockets.frames import Frame, Opcode
from websockets.http11 import Request, Response
from websockets.protocol import Event, State
from websockets.server import ServerProtocol

from deploy.operator.page.protocol import MAX_SIZE
from deploy.operator.page.records import Download
from deploy.operator.page.site import is_direct

CHUNK = 4096  # bytes that are read at a time
MAX_FRAMES = 400  # of a page within a second, answers to pings included
MAX_FIRST_FRAMES = 4  # within a second until the page has said hello
MAX_REQUEST = 16_384  # bytes; a browser sends the cookies of all pages of the host
REQUEST_TIMEOUT = 2.0  # s from the connection to the request, handshake of TLS included
HELLO_TIMEOUT = 2.0  # s from the start of the WebSocket
CLOSE_TIMEOUT = 1.0  # s
DOWNLOAD_TIMEOUT = 10.0  # s without progress
MAX_UNSENT = 1_000_000  # bytes; a file of the page is smaller
BAD_REQUEST, TOO_LATE, TOO_MANY = 4400, 4408, 4429  # codes of a close
_LIBRARY_FAILURES = (1002, 1007, 1009)  # protocol error, bad text, message too big (RFC 6455 7.4.1)
_NOT_NOW = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class Allowance:
    """A bound on how often something happens within a second."""

    def __init__(self, limit: int) -> None:
        """:param limit: greatest number within a second."""
        self._limit = limit
        self._begin = -math.inf
        self._count = 0

    def is_exceeded(self, now: float) -> bool:
        """Count one more at a time [s]; return whether it is too many."""
        if now - self._begin >= 1.0:
            self._begin, self._count = now, 0
        self._count += 1
        return self._count > self._limit


class Connection:
    def __init__(
        self,
        client: socket.socket,
        tls: ssl.SSLContext | None,
        answer: Callable[[Request], Response | None],
        now: float,
    ) -> None:
        """Take over a socket. Raises OSError if its client has gone already.

        :param answer: returns the response to a request; ``None`` begins a WebSocket.
        :param now: the time [s], as in all methods.
        """
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.address = client.getpeername()[0]
        """The IP address of the client."""
        self.is_local = ipaddress.ip_address(self.address).is_loopback
        """Whether the client is on this machine, and no proxy of others."""
        self.problem = ""
        """How the client has violated the protocol; empty if it has not."""
        self.has_ended = False
        self.has_answered = True
        """Whether the last ping was answered."""
        self.deadline = now + REQUEST_TIMEOUT
        """The time at which the connection ends, if it does not get any further [s]."""
        self._answer = answer
        self._protocol = ServerProtocol(max_size=MAX_SIZE)
        self._request_size = 0
        self._frames = Allowance(MAX_FIRST_FRAMES)
        self._unsent = bytearray()
        self._download: Download | None = None
        self._sends_no_more = False
        self._waits_to_write = False
        self._shakes_hands = tls is not None
        self.socket = client
        if tls is not None:
            self.socket = tls.wrap_socket(client, server_side=True, do_handshake_on_connect=False)

    @property
    def is_open(self) -> bool:
        """Whether the client can send and get messages."""
        return not self.has_ended and self._protocol.state is State.OPEN

    @property
    def is_idle(self) -> bool:
        return not self._unsent

    @property
    def events(self) -> int:
        """The events of the selector that the connection waits for."""
        waits_to_write = self._unsent or self._waits_to_write
        return selectors.EVENT_READ | (selectors.EVENT_WRITE if waits_to_write else 0)

    def admit(self) -> None:
        """Keep the connection from now on: its client is a page."""
        self.deadline = math.inf
        self._frames = Allowance(MAX_FRAMES)

    def receive(self, now: float) -> list[str | bytes]:
        """Receive and send what is possible; return the messages that have come."""
        messages: list[str | bytes] = []
        self._waits_to_write = False
        try:
            if self._shakes_hands and isinstance(self.socket, ssl.SSLSocket):
                self.socket.do_handshake()
                self._shakes_hands = False
            self._feed(self.socket.recv(CHUNK), now, messages)
            while isinstance(self.socket, ssl.SSLSocket) and not self.has_ended and self.socket.pending():
                self._feed(self.socket.recv(CHUNK), now, messages)
        except _NOT_NOW as error:
            self._waits_to_write = isinstance(error, ssl.SSLWantWriteError)
        except OSError:
            self.close()
        self._flush(now)
        return messages

    def send(self, message: str, now: float) -> None:
        """Send a message, now or when it is possible."""
        self._protocol.send_text(message.encode())
        self._flush(now)

    def ping(self, now: float) -> None:
        self.has_answered = False
        self._protocol.send_ping(b"")
        self._flush(now)

    def fail(self, code: int, reason: str, now: float, *, by_client: bool = True) -> None:
        """End the connection with a code and a reason, which is the client's doing or not."""
        self.problem = self.problem or (reason if by_client else "")
        self._protocol.fail(code, reason)
        self._flush(now)

    def close(self) -> None:
        self.has_ended = True
        self._unsent.clear()
        self._end_download()
        self.socket.close()

    def _end_download(self) -> None:
        if self._download:
            self._download.file.close()
            self._download = None

    def _feed(self, data: bytes, now: float, messages: list[str | bytes]) -> None:
        if not data:
            self._protocol.receive_eof()
            self._note_problem()
            self.close()
            return
        if self._protocol.state is State.CONNECTING:
            self._request_size += len(data)
            if self._request_size > MAX_REQUEST:
                self.problem = f"a request is longer than {MAX_REQUEST} bytes"
                self.close()
                return
        self._protocol.receive_data(data)
        events = self._protocol.events_received()
        for event in events:
            if not isinstance(event, Request):
                self._take(event, now, messages)
            elif len(events) > 1 or self._protocol.close_expected():
                self.problem = "a client does not wait for the response to its request"
                self.close()
            else:
                self.is_local = self.is_local and is_direct(event)
                response = self._answer(event) or self._protocol.accept(event)
                self._download = response if isinstance(response, Download) else None
                self._protocol.send_response(response)
                self.deadline = now + HELLO_TIMEOUT
        self._note_problem()

    def _take(self, frame: Event, now: float, messages: list[str | bytes]) -> None:
        assert isinstance(frame, Frame)
        if not self.is_open:
            return
        if self._frames.is_exceeded(now):
            self.fail(TOO_MANY, "a connection sends too many frames", now)
        elif frame.opcode is Opcode.PONG:
            self.has_answered = True
        elif frame.opcode is Opcode.CONT or not frame.fin:
            self.fail(BAD_REQUEST, "a message comes in fragments", now)
        elif frame.opcode is Opcode.BINARY:
            messages.append(bytes(frame.data))
        elif frame.opcode is Opcode.TEXT:
            try:
                messages.append(bytes(frame.data).decode())
            except UnicodeDecodeError:
                self.fail(BAD_REQUEST, "a message is not UTF-8", now)

    def _note_problem(self) -> None:
        error, sent = self._protocol.handshake_exc, self._protocol.close_sent
        # A browser opens connections that it does not use.
        if error is not None and not isinstance(error.__cause__, EOFError):
            self.problem = self.problem or "a request is not valid HTTP or no WebSocket"
        if sent is not None and sent.code in _LIBRARY_FAILURES and not self._protocol.close_rcvd_then_sent:
            self.problem = self.problem or "a frame is outside the WebSocket protocol"

    def _flush(self, now: float) -> None:
        for data in self._protocol.data_to_send():
            self._sends_no_more = self._sends_no_more or not data
            self._unsent += data
        if self._protocol.close_expected() and not self._download:
            self.deadline = min(self.deadline, now + CLOSE_TIMEOUT)
        if self.has_ended:
            return
        try:
            while self._unsent:
                del self._unsent[: self.socket.send(self._unsent)]
            if self._download:  # a piece at a time: meanwhile, others are served
                self._unsent += self._download.next()
                self.deadline = now + (DOWNLOAD_TIMEOUT if self._unsent else CLOSE_TIMEOUT)
            if not self._unsent:
                self._end_download()
                if self._sends_no_more:
                    self.socket.shutdown(socket.SHUT_WR)
        except _NOT_NOW:
            pass
        except OSError:
            self.close()
        if len(self._unsent) > MAX_UNSENT:
            self.close()
