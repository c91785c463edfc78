from __future__ import annotations

import contextlib
import itertools
import json
import math
import queue
import shutil
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from deploy.operator import hold
from deploy.operator.holder import Holder
from deploy.operator.page import address, protocol, server, state
from deploy.operator.page.state import PageState
from interfaces.reactive_node.tests.leftovers import assert_nothing_is_left
from tests.operator.page.clients import TOKEN, Arm, SleepyPage, close_code, end, hello, update


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Arm]:
    (tmp_path / "index.html").write_text("<!doctype html>")
    (tmp_path / "main.js").write_text("hello()")
    arm = Arm(tmp_path)
    yield arm
    arm.close()


# Files


def test_index_and_files_are_served_with_type_and_security_headers(arm: Arm) -> None:
    status, head, body = arm.get("/")
    assert (status, body) == (200, b"<!doctype html>")
    assert "Content-Type: text/html; charset=utf-8" in head
    assert "Content-Security-Policy: default-src 'self'; connect-src 'self'; frame-ancestors 'none';" in head
    for line in (
        "X-Content-Type-Options: nosniff",
        "Referrer-Policy: no-referrer",
        "Cache-Control: no-store",
    ):
        assert line in head
    assert "Set-Cookie" not in head
    assert "Access-Control" not in head
    status, head, body = arm.get("/static/main.js")
    assert (status, body) == (200, b"hello()")
    assert "Content-Type: text/javascript; charset=utf-8" in head


@pytest.mark.parametrize(
    "path",
    [
        "/static/",
        "/static/../server.py",
        "/static/%2e%2e/server.py",
        "/static//etc/passwd",
        "//etc/passwd",
        "/etc/passwd",
        "/index.html",
        "/?x=1",
        "/static/main.js?x",
        "/static/main.js/",
        "/static/MAIN.JS",
        "http://127.0.0.1/",
        "*",
        "/" + "a" * 8000,
    ],
)
def test_every_other_path_is_not_found(arm: Arm, path: str) -> None:
    status, head, _ = arm.get(path)

    assert status == 404
    assert "Content-Security-Policy" in head


@pytest.mark.parametrize("method", ["POST", "HEAD", "PUT", "DELETE", "OPTIONS", "TRACE", "BREW"])
def test_other_methods_are_refused(arm: Arm, method: str) -> None:
    assert arm.get("/", method=method)[0] == 405
    assert "GET" in arm.next(server.Violation).reason


@pytest.mark.parametrize(
    "host",
    ["", "evil.example", "evil.example:80", "127.0.0.1.evil.example:80", "127.0.0.1:x", "evil:1@localhost:1"],
)
@pytest.mark.parametrize("path", ["/", "/socket"])
def test_other_host_names_are_refused(arm: Arm, host: str, path: str) -> None:
    status, _, body = arm.get(path, Host=host, Origin=f"http://{host}")
    assert status == 403
    assert b"Open the one that the terminal shows" in body
    assert "host" in arm.next(server.Violation).reason


def test_second_host_header_is_refused(arm: Arm) -> None:
    answer = arm.request(f"GET / HTTP/1.1\r\nHost: {arm.host}\r\nHost: {arm.host}\r\n\r\n".encode())

    assert b" 403 " in answer


@pytest.mark.parametrize(
    ("host", "scheme", "is_local"),
    [
        *((host, "http", True) for host in ("localhost", "localhost:9000", "127.0.0.1:9000")),
        *((host, "https", False) for host in ("arm.example", "arm.example:8443")),
    ],
)
def test_page_is_reached_by_a_tunnel_and_by_a_proxy_that_ends_tls(
    arm: Arm, host: str, scheme: str, is_local: bool
) -> None:
    """A tunnel has another port; the user of a proxy may be anywhere."""
    assert arm.get("/", Host=host)[0] == 200
    client = socket.create_connection(("127.0.0.1", arm.port))
    origin = Origin(f"{scheme}://{host}")
    with connect(f"ws://{host}/socket", sock=client, origin=origin, compression=None) as page:
        assert hello(page)["local"] is is_local


def test_reverse_proxy_that_hides_the_name_is_told_what_to_do(arm: Arm) -> None:
    status, _, body = arm.get("/socket", Origin="https://arm.example")
    assert status == 403
    assert b"A reverse proxy must pass on the Host of the browser." in body


@pytest.mark.parametrize("header", ["X-Forwarded-For", "x-forwarded-host", "Forwarded"])
def test_page_behind_a_proxy_is_not_local(arm: Arm, header: str) -> None:
    with arm.connect(additional_headers={header: "1"}) as page:
        assert hello(page)["local"] is False


# The token


@pytest.mark.parametrize(
    "origin",
    [None, "null", "http://evil.example", "https://127.0.0.1", "http://localhost", "http://localhost:9000"],
)
def test_other_origins_open_no_socket(arm: Arm, origin: Any) -> None:
    with pytest.raises(InvalidStatus) as refused, arm.connect(origin=origin):
        pass
    assert refused.value.response.status_code == 403
    assert "origin" in arm.next(server.Violation).reason


@pytest.mark.parametrize("token", ["", "s3cr3t-toke", "s3cr3t-tokeN", "s3cr3t-token "])
def test_wrong_token_closes_the_connection(arm: Arm, token: str) -> None:
    with arm.connect() as page:
        page.send(json.dumps({"type": "hello", "token": token}))
        assert close_code(page) == 4401
    assert "token" in arm.next().reason


def test_press_before_hello_closes_the_connection(arm: Arm) -> None:
    with arm.connect() as page:
        page.send('{"type": "press", "nonce": ""}')
        assert close_code(page) == 4400
    assert arm.next() == server.Violation("a page does not begin with hello")


def test_welcome_says_what_the_page_needs(arm: Arm) -> None:
    with arm.connect() as page:
        welcome = hello(page)

    assert {key: welcome[key] for key in ("type", "local", "strikes")} == {
        "type": "welcome",
        "local": True,
        "strikes": 3,
    }
    assert arm.next() == server.Opened(welcome["page"])
    assert arm.next() == hold.Release(welcome["page"])
    assert arm.next() == server.Closed(welcome["page"])


# Messages


def test_beats_carry_the_time_of_their_nonce(arm: Arm) -> None:
    with arm.page() as page:
        nonce = update(page)["nonce"]
        page.send(json.dumps({"type": "press", "nonce": nonce}))
        page.send(json.dumps({"type": "beat", "nonce": nonce}))
        page.send(json.dumps({"type": "beat", "nonce": "guess"}))
        press, *beats = arm.next(hold.Press), arm.next(), arm.next()

    assert 0.0 <= hold.monotonic() - press.sent < 5.0
    assert [beat.sent for beat in beats] == [press.sent, float("-inf")]
    assert {beat.page for beat in beats} == {press.page}


def test_nonce_of_another_page_counts_for_nothing(arm: Arm) -> None:
    with arm.page() as one, arm.page() as two:
        one.send(json.dumps({"type": "press", "nonce": update(two)["nonce"]}))

        assert arm.next(hold.Press).sent == float("-inf")


def test_requests_name_their_page(arm: Arm) -> None:
    with arm.page() as page:
        page.send('{"type": "engines", "command": "turn_off"}')
        opened, request = arm.next(), arm.next()

    assert request == server.Request(opened.page, protocol.Engines("turn_off"), is_local=True)


@pytest.mark.parametrize("text", ["", "nonsense", '{"type": "hello", "token": "s3cr3t-token"}', b"binary"])
def test_message_outside_the_protocol_closes_the_connection(arm: Arm, text: str | bytes) -> None:
    with arm.page() as page:
        page.send(text)
        assert close_code(page) == 4400
        opened, *left = arm.next(), arm.next(), arm.next()
    assert left == [hold.Release(opened.page), server.Closed(opened.page)]
    assert isinstance(arm.next(), server.Violation)


def test_long_message_closes_the_connection(arm: Arm) -> None:
    with arm.page() as page:
        page.send("x" * 2000)
        assert close_code(page) == 1009
    assert arm.next(server.Violation)


def test_page_that_sends_too_much_is_closed(arm: Arm) -> None:
    with arm.page() as page:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(server.MAX_MESSAGES + 1):
                page.send('{"type": "release"}')
        assert close_code(page) == 4429
    assert arm.next(server.Violation).reason == "a page sends too much"


def test_flood_of_pings_is_closed(arm: Arm) -> None:
    with arm.page() as page:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(5000):
                page.ping()
        end(page)
    assert arm.next(server.Violation, 10.0).reason == "a connection sends too many frames"


# Updates


def test_page_that_opens_later_gets_the_history(arm: Arm) -> None:
    arm.state = PageState(
        hands=state.Hands(holder=Holder(1e9, {"terminal_7": 1e9}))
    )  # held for a long time to come
    with arm.page() as page:
        update(page)
        with arm.connect() as later:
            ((time, moment),) = hello(later)["history"]
    assert (time, moment["switch"]) == (1.25, {"held": True, "by": "terminal"})


def test_history_goes_on_after_the_last_page_has_closed_until_its_span_ends(
    arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    noted: queue.SimpleQueue[PageState] = queue.SimpleQueue()
    monkeypatch.setattr(server, "lasting", lambda state, _: noted.put(state))
    monkeypatch.setattr(server, "SPAN", 3.0)
    with arm.page() as page:
        update(page)
    arm.next(server.Closed)
    arm.state = PageState(arm=state.Arm(speed=1.0, sped=math.inf))

    while noted.get(timeout=5.0) is not arm.state:
        pass
    rest = itertools.islice(iter(lambda: noted.get(timeout=1.5), None), 200)
    with pytest.raises(queue.Empty):
        list(rest)


def test_page_that_sleeps_finds_the_newest_state_and_no_queue(arm: Arm) -> None:
    with contextlib.closing(SleepyPage(arm)) as page:
        assert page.wake(0.5)[0]["type"] == "welcome"
        for tick in range(40):
            arm.state = PageState(arm=state.Arm(speed=float(tick), sped=math.inf))
            time.sleep(0.05)
        messages = page.wake(0.5)

    speeds = [found["speed"] for found in messages if "speed" in found]
    assert speeds[-1] == 39.0
    assert len(speeds) < 20, "the updates of the time until a ping is missed, and the newest"
    assert max(later - earlier for earlier, later in itertools.pairwise(speeds)) > 20


def test_page_that_never_answers_is_closed(arm: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "DEAD", 1.0)
    with contextlib.closing(SleepyPage(arm)):
        opened = arm.next(server.Opened)
        assert arm.next() == hold.Release(opened.page)
        assert arm.next() == server.Closed(opened.page)


# Bounds


def test_too_many_pages_are_refused(arm: Arm) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(server.MAX_PAGES):
            stack.enter_context(arm.page())
        with arm.connect() as page:
            page.send(json.dumps({"type": "hello", "token": TOKEN}))
            assert close_code(page) == 4429
        assert arm.next(server.Violation).reason == server.FULL


def test_page_that_does_not_answer_makes_room(arm: Arm) -> None:
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.closing(SleepyPage(arm)))
        silent = arm.next(server.Opened).page
        for _ in range(server.MAX_PAGES - 1):
            stack.enter_context(arm.page())
            arm.next(server.Opened)
        deadline = time.monotonic() + 5.0
        while True:
            with arm.connect() as page, contextlib.suppress(ConnectionClosed):
                assert hello(page)["type"] == "welcome"
                break
            assert time.monotonic() < deadline, "its place stays taken"
        assert arm.next(server.Closed).page == silent


@pytest.mark.parametrize(
    "raw",
    [
        b"\x00\xff\r\n\r\n",
        b"GET /\r\n\r\n",
        b"GET / HTTP/1.1\r\nno colon\r\n\r\n",
        b"GET / HTTP/1.1\r\nX: " + 9000 * b"y" + b"\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + 200 * b"X: y\r\n" + b"\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: 5\r\n\r\nhello",
    ],
)
def test_malformed_request_is_counted(arm: Arm, raw: bytes) -> None:
    assert not arm.request(raw).startswith(b"HTTP/1.1 200")
    assert arm.next() == server.Violation("a request is not valid HTTP or no WebSocket")


def test_client_that_does_not_wait_for_its_response_is_closed(arm: Arm) -> None:
    request = (
        f"GET /socket HTTP/1.1\r\nHost: {arm.host}\r\nOrigin: {arm.origin}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Key: {22 * 'A'}==\r\n\r\n"
    )
    for early in (b"\x88\x80\0\0\0\0", b"\x89\x80\0\0\0\0", b"\xff\xff"):
        assert arm.request(request.encode() + early) == b""
        assert "does not wait" in arm.next(server.Violation).reason


def test_connection_that_is_not_used_is_not_counted(arm: Arm) -> None:
    with socket.create_connection(("127.0.0.1", arm.port)):
        pass
    assert arm.get("/")[0] == 200
    assert arm.received.empty()


def test_page_over_tls(tmp_path: Path) -> None:
    if shutil.which("openssl") is None:
        pytest.skip("platform: no openssl to make a certificate with")
    certificate, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-nodes", "-newkey", "rsa:2048", "-days", "2", "-subj", "/CN=arm"),
            *("-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)),
        ],
        check=True,
        capture_output=True,
    )
    (tmp_path / "static").mkdir()
    (tmp_path / "static" / "index.html").write_text("")
    arm = Arm(tmp_path / "static", address.tls("127.0.0.1", str(certificate), str(key)))
    try:
        assert arm.request(f"GET / HTTP/1.1\r\nHost: {arm.host}\r\n\r\n".encode()) == b"", "not over TLS"
        context = ssl.create_default_context(cafile=certificate)
        with contextlib.closing(SleepyPage(arm, context)) as page:
            messages = page.wake(0.5)
        assert [message["type"] for message in messages[:2]] == ["welcome", "update"]
        arm.origin = f"http://{arm.host}"
        with pytest.raises(InvalidStatus):
            SleepyPage(arm, context)
    finally:
        arm.close()


def test_nothing_is_left_when_the_server_closes(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("")
    arm = Arm(tmp_path)
    with arm.page() as page:
        arm.close()
        end(page)
    deadline = time.monotonic() + 5.0
    while any(thread.name == "page" for thread in threading.enumerate()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", arm.port))


def test_nothing_is_left_of_pages_that_open_and_close(arm: Arm) -> None:
    def open_and_close() -> None:
        assert arm.get("/")[0] == 200
        with arm.page() as page:
            update(page)
        arm.next(server.Closed)
        while sum(thread.name == "page" for thread in threading.enumerate()) > 1:
            time.sleep(0.001)

    assert_nothing_is_left(open_and_close, lambda: None, times=30)
