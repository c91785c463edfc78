"""The web server of the page: HTTP for its files, a WebSocket for each page that is open.

Each connection has a thread. Towards the node there are two calls: ``receive`` hands over what a page did,
and ``newest`` returns the newest state, an immutable value. A slow page holds nothing up, and nothing queues
for it: while it does not answer it gets no updates, and then one with the newest state.
"""

from __future__ import annotations

import ipaddress
import json
import secrets
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, cast

from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request as HttpRequest
from websockets.http11 import Response
from websockets.protocol import Event as ReceivedEvent
from websockets.sync.server import Server, ServerConnection, serve

from deploy.console.page import hold, protocol
from deploy.console.page.site import SOCKET, Site, respond
from deploy.console.page.state import Clock, PageState
from deploy.console.page.updates import Updates

MAX_CONNECTIONS = 32  # a browser opens six to load the page
MAX_PAGES = 8
MAX_MESSAGES = 100  # of a page within a second; a page that is held sends 20
MAX_FRAMES = 400  # of a connection within a second, answers to pings and fragments included
ACCEPT_PERIOD = 0.005  # s between two new connections
ACCEPT_RETRY = 0.1  # s after an error, such as too many open files
UPDATE_PERIOD = 0.05  # s
HELLO_TIMEOUT = 2.0  # s
REQUEST_TIMEOUT = 5.0  # s
CLOSE_TIMEOUT = 1.0  # s
PING_PERIOD = 0.25  # s
SLOW = 0.5  # s without an answer to a ping: the page gets no updates until it answers
DEAD = 10.0  # s without an answer: the connection is closed
BAD_REQUEST, UNAUTHORIZED, TOO_LATE, TOO_MANY = 4400, 4401, 4408, 4429  # codes of a close
SILENT = 1001  # code of a close for which the page need not be to blame: going away
LIBRARY_REFUSALS = (1002, 1007, 1009)  # protocol error, bad text, message too big (RFC 6455 7.4.1)


class Opened(NamedTuple):
    """A page has presented the token."""

    page: str


class Closed(NamedTuple):
    """A page has left, however that happened."""

    page: str


class Request(NamedTuple):
    """A page asks for something beside the switch."""

    page: str
    message: protocol.Engines | protocol.Set | protocol.FollowScenario | protocol.Process
    is_local: bool
    """Whether the page is on this machine."""


class Violation(NamedTuple):
    """A connection was closed because of input outside the protocol."""

    reason: str


Event = Opened | Closed | hold.Event | Request | Violation


class _Close(Exception):
    """The connection must be closed, with a code and a reason."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code


class Allowance:
    """A bound on how often something happens within a second."""

    def __init__(self, limit: int) -> None:
        """:param limit: greatest number within a second."""
        self._limit = limit
        self._begin = 0.0
        self._count = 0

    def is_exceeded(self, now: float) -> bool:
        """Count one more at a time [s]; return whether it is too many."""
        if now - self._begin >= 1.0:
            self._begin, self._count = now, 0
        self._count += 1
        return self._count > self._limit


class PageServer:
    """Serves one site until it is closed."""

    def __init__(
        self,
        listener: socket.socket,
        site: Site,
        *,
        welcome: Mapping[str, Any],
        receive: Callable[[Event], None],
        newest: Callable[[], PageState],
        clock: Clock,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        """
        Start to serve, in threads of its own.

        :param listener: a listening TCP socket; the server closes it.
        :param welcome: what every page is told first.
        :param receive: called on the thread of a connection for each event of a page.
        :param newest: returns the newest state; called on the thread of each connection.
        """
        self._site = site
        self._welcome = welcome
        self._receive = receive
        self._newest = newest
        self._clock = clock
        self._now = clock.now
        self._free = threading.Semaphore(MAX_CONNECTIONS)
        self._free_pages = threading.Semaphore(MAX_PAGES)
        self._connections: dict[int, _Connection] = {}  # by the thread that serves it
        self._server: Server = serve(
            self._serve_page,
            sock=listener,
            ssl=tls,
            compression=None,
            process_request=self._respond,
            server_header=None,
            open_timeout=REQUEST_TIMEOUT,
            ping_interval=None,
            close_timeout=CLOSE_TIMEOUT,
            max_size=protocol.MAX_SIZE,
            max_queue=None,  # it is bounded by MAX_FRAMES; a full queue would delay a close
            create_connection=cast(Any, self._make_connection),
        )
        self._accepting = threading.Thread(target=self._accept, name="page", daemon=True)
        self._accepting.start()

    def close(self) -> None:
        """Stop to listen, and close all connections."""
        with suppress(OSError):
            self._server.socket.shutdown(socket.SHUT_RDWR)  # which wakes the accepting thread
        self._accepting.join()
        for connection in list(self._connections.values()):
            connection.close_socket()
        self._server.shutdown()

    def _accept(self) -> None:
        """Accept connections; unlike ``serve_forever``, a bounded number, and also after an error."""
        listener = self._server.socket
        while listener.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
            try:
                client, address = listener.accept()
            except OSError:
                time.sleep(ACCEPT_RETRY)
                continue
            if self._free.acquire(blocking=False):
                threading.Thread(target=self._run, args=(client, address), name="page", daemon=True).start()
            else:
                client.close()
                self._receive(Violation("too many connections"))
            time.sleep(ACCEPT_PERIOD)
        self._server.shutdown_watcher.close()
        self._server.socket_closed.set()

    def _run(self, client: socket.socket, address: Any) -> None:
        try:
            self._server.handler(client, address)
        finally:
            connection = self._connections.pop(threading.get_ident(), None)
            if connection is not None and connection.problem:
                self._receive(Violation(connection.problem))
            self._free.release()

    def _make_connection(self, *arguments: Any, **options: Any) -> _Connection:
        connection = _Connection(*arguments, **options)
        self._connections[threading.get_ident()] = connection
        return connection

    def _respond(self, connection: ServerConnection, request: HttpRequest) -> Response | None:
        """Answer a request; ``None`` lets a WebSocket begin."""
        if refusal := self._site.refusal(request):
            self._receive(Violation(refusal.reason))
            return respond(refusal.status)
        return None if request.path == SOCKET else self._site.file(request.path)

    def _serve_page(self, connection: ServerConnection) -> None:
        assert isinstance(connection, _Connection)
        page = secrets.token_hex(8)
        try:
            self._await_token(connection)
            with self._opened(page):
                self._exchange(connection, page)
        except _Close as close:
            if close.code != SILENT:
                self._receive(Violation(str(close)))
            connection.close(close.code, str(close))
        except ConnectionClosed as closed:
            if closed.sent and not closed.rcvd and closed.sent.code in LIBRARY_REFUSALS:
                self._receive(Violation("a frame is outside the WebSocket protocol"))

    def _await_token(self, connection: ServerConnection) -> None:
        try:
            hello = _parse(connection.recv(timeout=HELLO_TIMEOUT))
        except TimeoutError:
            raise _Close(TOO_LATE, "a page says no hello") from None
        if not isinstance(hello, protocol.Hello):
            raise _Close(BAD_REQUEST, "a page does not begin with hello")
        if not self._site.is_token(hello.token):
            raise _Close(UNAUTHORIZED, "a page has a wrong token")

    @contextmanager
    def _opened(self, page: str) -> Iterator[None]:
        if not self._free_pages.acquire(blocking=False):
            raise _Close(TOO_MANY, "too many pages are open")
        self._receive(Opened(page))
        try:
            yield
        finally:
            self._free_pages.release()
            self._receive(hold.Release(page))
            self._receive(Closed(page))

    def _exchange(self, connection: _Connection, page: str) -> None:
        """Alternate between messages of a page and updates to it, until it leaves."""
        is_local = connection.is_local
        nonces, messages, updates = hold.Nonces(), Allowance(MAX_MESSAGES), Updates(page, self._clock)
        connection.send(_text({"type": "welcome", "page": page, "local": is_local, **self._welcome}))
        due = asked = self._now()
        answer = connection.ping()
        while True:
            now = self._now()
            if now < due:
                with suppress(TimeoutError):
                    text = connection.recv(timeout=due - now)
                    if messages.is_exceeded(now):
                        raise _Close(TOO_MANY, "a page sends too much")
                    self._receive(_event(page, _parse(text), nonces, is_local))
                continue
            due = max(due + UPDATE_PERIOD, now)
            if answer.is_set() and now - asked >= PING_PERIOD:
                asked, answer = now, connection.ping()
            if now - asked < SLOW:
                state = self._newest()
                for message in (*updates.refusals(state), updates.update(state, nonces.issue(now), now)):
                    connection.send(_text(message))
            elif now - asked > DEAD:
                raise _Close(SILENT, "the page does not answer")


class _Connection(ServerConnection):
    """A connection that counts its frames, also pings and fragments, which its handler does not see."""

    def __init__(self, client: socket.socket, *arguments: Any, **options: Any) -> None:
        self.is_local = ipaddress.ip_address(client.getpeername()[0]).is_loopback
        self._frames = Allowance(MAX_FRAMES)
        self._flooded = False
        super().__init__(client, *arguments, **options)

    @property
    def problem(self) -> str:
        """What was wrong with the input, beside the messages; empty if nothing was."""
        error = self.protocol.handshake_exc
        if self._flooded:
            return "a connection sends too many frames"
        if error is None or isinstance(error.__cause__, EOFError):  # a browser may open one and not use it
            return ""
        return "a request is not valid HTTP or no WebSocket"

    def process_event(self, event: ReceivedEvent) -> None:
        """Close the connection if its frames come too fast."""
        self._flooded = self._flooded or self._frames.is_exceeded(time.monotonic())
        if self._flooded:
            self.close_socket()
        else:
            super().process_event(event)


def _event(page: str, message: protocol.Message, nonces: hold.Nonces, is_local: bool) -> Event:
    match message:
        case protocol.Press(nonce):
            return hold.Press(page, nonces.sent(nonce))
        case protocol.Beat(nonce):
            return hold.Beat(page, nonces.sent(nonce))
        case protocol.Release():
            return hold.Release(page)
        case protocol.Hello():
            raise _Close(BAD_REQUEST, "a page says hello twice")
        case _:
            return Request(page, message, is_local)


def _parse(text: str | bytes) -> protocol.Message:
    try:
        return protocol.parse(text)
    except protocol.ProtocolError as error:
        raise _Close(BAD_REQUEST, str(error)) from None


def _text(message: Mapping[str, Any]) -> str:
    return json.dumps(message, separators=(",", ":"), allow_nan=False)
