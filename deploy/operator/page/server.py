"""The web server of the page: HTTP for its files, a WebSocket for each page that is open.

One thread serves all clients and never blocks. It shares two calls with the node: ``receive`` hands over
what a page did, and ``newest`` returns the newest state, an immutable value. A slow page holds nothing up,
and nothing queues for it: it gets no updates while it does not answer, and then one with the newest state.
"""

from __future__ import annotations

import json
import math
import secrets
import selectors
import socket
import ssl
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from websockets.http11 import Request as HttpRequest
from websockets.http11 import Response

from deploy.operator import hold
from deploy.operator.page import protocol
from deploy.operator.page.connection import BAD_REQUEST, TOO_LATE, TOO_MANY, Allowance, Connection
from deploy.operator.page.history import SPAN, History
from deploy.operator.page.records import Records
from deploy.operator.page.site import SOCKET, Site, respond
from deploy.operator.page.state import Clock, PageState
from deploy.operator.page.updates import Updates, lasting
from interfaces.plain_text import plain

MAX_PAGES = 8
MAX_STRANGERS = 256  # connections that have not presented the token
GRACE = 0.25  # s that each of them has, however many come
SHARE = 8  # of these that an address has before it has more than others: a browser opens six to load the page
MAX_ACCEPTED = 32  # at a time
STRANGERS_TIME = 0.01  # s that strangers are served until it is the turn of the pages again
MAX_MESSAGES = 100  # of a page within a second; a page that is held sends 20
UPDATE_PERIOD = 0.05  # s
PING_PERIOD = 0.25  # s
SLOW = 0.5  # s without an answer to a ping: the page gets no updates until it answers
DEAD = 10.0  # s without an answer: the connection is closed
ACCEPT_RETRY = 0.02  # s after an error, such as too many open files
UNAUTHORIZED, GOING_AWAY = 4401, 1001  # codes of a close
FULL = f"{MAX_PAGES} pages are open already: close one, and this one opens"


class Opened(NamedTuple):
    page: str


class Closed(NamedTuple):
    """A page has left, however that happened."""

    page: str


class Request(NamedTuple):
    """A page asks for something besides the switch."""

    page: str
    message: protocol.Engines | protocol.Set | protocol.FollowScenario | protocol.Process | protocol.Fault
    is_local: bool
    """Whether the page is on this machine."""


class Violation(NamedTuple):
    """Connections were closed because of input outside the protocol."""

    reason: str
    times: int = 1


Event = Opened | Closed | hold.Event | Request | Violation


class _Client:
    """A connection, and the page at its other end once that has presented the token."""

    def __init__(self, connection: Connection, now: float) -> None:
        self.connection = connection
        self.began = now
        self.page = ""
        self.nonces = hold.Nonces()
        self.messages = Allowance(MAX_MESSAGES)
        self.updates: Updates | None = None
        self.pinged = 0.0
        self.is_reported = False  # that it was outside the protocol


class PageServer:
    def __init__(
        self,
        listener: socket.socket,
        site: Site,
        records: Records,
        *,
        welcome: Mapping[str, Any],
        receive: Callable[[Event], None],
        newest: Callable[[], PageState],
        clock: Clock,
        fail: Callable[[Exception], None],
        tls: ssl.SSLContext | None,
    ) -> None:
        """Serve on a thread that calls ``receive`` with each event of a page.

        :param listener: a listening TCP socket; the server closes it.
        :param welcome: what every page receives first.
        :param newest: returns the newest state; called on the thread.
        :param fail: called on the thread if that ends in an error.
        """
        self._listener = listener
        self._site = site
        self._records = records
        self._welcome = welcome
        self._receive = receive
        self._newest = newest
        self._clock = clock
        self._fail = fail
        self._tls = tls
        self._clients: list[_Client] = []
        self._violations: Counter[str] = Counter()  # that are not reported yet: a flood of them comes at once
        self._history = History()
        self._shown = -math.inf  # when a page was open for the last time
        self._due = 0.0
        self._selector = selectors.DefaultSelector()
        listener.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ)
        self._wake, self._woken = socket.socketpair()
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._is_closing = False
        self._is_full = False
        """Whether nobody is accepted until the next update."""
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._is_closing = True
        self._wake.close()  # which the other end notices
        self._thread.join()

    def _serve(self) -> None:
        try:
            while not self._is_closing:
                self._serve_once()
        except Exception as error:
            self._fail(error)
        finally:
            for client in list(self._clients):
                client.connection.close()
                self._settle(client)
            self._selector.close()
            self._listener.close()
            self._woken.close()

    def _serve_once(self) -> None:
        # Without clients there is nothing to do, but for the history.
        is_busy = self._clients or self._violations or self._clock.now() - self._shown < SPAN
        wait = max(0.0, self._due - self._clock.now()) if is_busy else None
        ready = [key for key, _ in self._selector.select(wait)]
        clients = [key.data for key in ready if key.data is not None]
        pages = [client for client in clients if client.page]
        for client in pages:
            self._hear(client)
        end = self._clock.now() + STRANGERS_TIME
        for client in clients:
            if self._clock.now() > end:
                break  # nobody makes room who has not been heard: the others are heard at the next turn
            if client not in pages:
                self._hear(client)
        else:
            if any(key.fileobj is self._listener for key in ready):
                self._accept()
        now = self._clock.now()
        if now >= self._due:
            self._due = max(self._due + UPDATE_PERIOD, now)
            self._update(now)

    def _hear(self, client: _Client) -> None:
        for text in client.connection.receive(self._clock.now()):
            self._take(client, text)
        self._settle(client)

    def _update(self, now: float) -> None:
        """Do what is due from time to time."""
        if any(client.page for client in self._clients):
            self._shown = now
        if now - self._shown < SPAN:
            self._history.note(round(self._clock.elapsed(), 3), lasting(self._newest(), now))
        for client in list(self._clients):
            self._tick(client, now)
            self._settle(client)
        if self._is_full:
            self._is_full = False
            self._selector.register(self._listener, selectors.EVENT_READ)
        for violation in self._violations.items():
            self._receive(Violation(*violation))
        self._violations.clear()

    def _accept(self) -> None:
        for _ in range(MAX_ACCEPTED):
            if not self._has_room():
                self._selector.unregister(self._listener)  # until the next update
                self._is_full = True
                return
            try:
                socket_, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError:
                time.sleep(ACCEPT_RETRY)
                return
            now = self._clock.now()
            try:
                connection = Connection(socket_, self._tls, self._answer, now)
            except OSError:
                socket_.close()
                continue
            client = _Client(connection, now)
            self._clients.append(client)
            self._selector.register(connection.socket, connection.events, client)

    def _has_room(self) -> bool:
        """Whether another stranger has room. If not, close an old one: one that comes may be the operator.

        It is the oldest of the address that has most of them, or of all if none has more than its share.
        """
        strangers = [client for client in self._clients if not client.page]
        if len(strangers) < MAX_STRANGERS:
            return True
        counts = Counter(client.connection.address for client in strangers)
        oldest = max(strangers, key=lambda client: max(SHARE, counts[client.connection.address]))
        if self._clock.now() - oldest.began < GRACE:
            return False
        oldest.connection.problem = "too many connections"
        oldest.connection.close()
        self._settle(oldest)
        return True

    def _answer(self, request: HttpRequest) -> Response | None:
        """Answer a request; ``None`` begins a WebSocket."""
        if refusal := self._site.refusal(request):
            self._violations[refusal.reason] += 1
            return respond(refusal.status, body=refusal.answer)
        if request.path == SOCKET:
            return None
        return self._records.answer(request.path) or self._site.file(request.path)

    def _take(self, client: _Client, text: str | bytes) -> None:
        now = self._clock.now()
        if not client.connection.is_open:
            return  # an earlier message has ended it
        try:
            message = protocol.parse(text)
        except protocol.ProtocolError as error:
            client.connection.fail(BAD_REQUEST, str(error), now)
            return
        if not client.page:
            self._admit(client, message, now)
        elif client.messages.is_exceeded(now):
            client.connection.fail(TOO_MANY, "a page sends too much", now)
        elif isinstance(message, protocol.Hello):
            client.connection.fail(BAD_REQUEST, "a page says hello twice", now)
        else:
            self._receive(_event(client, message))

    def _admit(self, client: _Client, message: protocol.Message, now: float) -> None:
        connection = client.connection
        if not isinstance(message, protocol.Hello):
            connection.fail(BAD_REQUEST, "a page does not begin with hello", now)
        elif not self._site.is_token(message.token):
            connection.fail(UNAUTHORIZED, "a page has a wrong token", now)
        elif not self._has_room_for_page(now):
            connection.fail(TOO_MANY, FULL, now)
        else:
            client.page = secrets.token_hex(8)
            client.updates = Updates(client.page, self._clock)
            client.pinged = now
            connection.admit()
            self._receive(Opened(client.page))
            welcome = {
                "type": "welcome",
                "page": client.page,
                "local": connection.is_local,
                "history": self._history.changes(),
            }
            connection.send(_text({**welcome, **self._welcome}), now)
            connection.ping(now)

    def _has_room_for_page(self, now: float) -> bool:
        """Whether another page has room. One that does not answer makes room: it may be the same, cut off."""
        pages = [client for client in self._clients if client.page]
        if len(pages) < MAX_PAGES:
            return True
        silent = min(pages, key=lambda client: client.pinged)
        if now - silent.pinged < SLOW:
            return False
        silent.connection.fail(GOING_AWAY, "another page takes the place", now, by_client=False)
        self._settle(silent)
        return True

    def _tick(self, client: _Client, now: float) -> None:
        """Send an update to a page that keeps up; end a connection that gets no further."""
        connection = client.connection
        if now > connection.deadline:
            if connection.is_open:
                connection.fail(TOO_LATE, "a page says no hello", now)
            else:
                connection.close()
        if client.updates is None or not connection.is_open:
            return
        if connection.has_answered and now - client.pinged >= PING_PERIOD:
            client.pinged = now
            connection.ping(now)
        if now - client.pinged > DEAD:
            connection.fail(GOING_AWAY, "the page does not answer", now, by_client=False)
        elif now - client.pinged < SLOW and connection.is_idle:
            state = self._newest()
            update = client.updates.update(state, client.nonces.issue(now), now)
            for message in (*client.updates.refusals(state), update):
                connection.send(_text(message), now)

    def _settle(self, client: _Client) -> None:
        """Report what has become of a client, and wait for what it waits for."""
        connection = client.connection
        if client.page and not connection.is_open:
            self._receive(hold.Release(client.page))
            self._receive(Closed(client.page))
            client.page, client.updates = "", None
        if connection.problem and not client.is_reported:
            self._violations[connection.problem] += 1
            client.is_reported = True
        if connection.has_ended:
            self._clients.remove(client)
            self._selector.unregister(connection.socket)
        elif connection.events != self._selector.get_key(connection.socket).events:
            self._selector.modify(connection.socket, connection.events, client)


def _event(client: _Client, message: protocol.Message) -> Event:
    match message:
        case protocol.Press(nonce):
            return hold.Press(client.page, client.nonces.sent(nonce))
        case protocol.Beat(nonce):
            return hold.Beat(client.page, client.nonces.sent(nonce))
        case protocol.Release() | protocol.Hello():
            return hold.Release(client.page)
        case _:
            return Request(client.page, message, client.connection.is_local)


def _text(message: Mapping[str, Any]) -> str:
    return json.dumps(_plain(message), separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    """Return a value in which all texts are plain: some are of others."""
    match value:
        case str():
            return plain(value)
        case Mapping():
            return {key: _plain(each) for key, each in value.items()}
        case list() | tuple():
            return [_plain(each) for each in value]
        case _:
            return value
