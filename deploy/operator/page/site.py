"""The files of the page over HTTP, and which requests are refused."""

from __future__ import annotations

import hmac
import http
import ipaddress
import re
from email.utils import formatdate
from pathlib import Path
from typing import NamedTuple

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

SOCKET = "/socket"
RECORDS = "/records"  # needs the token
STATIC = Path(__file__).parent / "static"
INDEX = "index.html"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}


WRONG_HOST = (
    b"This is no address of the page. Open the one that the terminal shows.\n"
    b"The parameter `names` of operator_page sets names of this machine, or of a proxy before it.\n"
)
WRONG_ORIGIN = b"This is another origin. A reverse proxy must pass on the Host of the browser.\n"
_HOST = re.compile(r"([^:]+)(:[0-9]+)?")


class Refusal(NamedTuple):
    status: http.HTTPStatus
    reason: str
    answer: bytes = b""
    """The answer to its sender; empty for the words of the status."""


class Site:
    """The files of the page, for clients that know its token and come by an accepted name."""

    def __init__(
        self, token: str, names: tuple[str, ...], scheme: str = "http", folder: Path = STATIC
    ) -> None:
        """Read the files: there are no others.

        :param names: the names in accepted ``Host`` headers. The port may be that of a tunnel or a reverse
            proxy. A page of somebody else that resolves to this machine has another name.
        """
        self._token = token.encode()
        self._names = names
        self._schemes = {scheme, "https"}  # a reverse proxy may end TLS
        files = {f"/static/{path.name}": (TYPES[path.suffix], path.read_bytes()) for path in folder.iterdir()}
        self._files = {"/": files[f"/static/{INDEX}"], **files}

    def is_token(self, text: str) -> bool:
        """Return whether a text is the token, in a time that shows nothing about it."""
        return hmac.compare_digest(text.encode(), self._token)

    def refusal(self, request: Request) -> Refusal | None:
        """Return why a request is refused, ``None`` if it is not."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or _without_port(hosts[0]) not in self._names:
            return Refusal(http.HTTPStatus.FORBIDDEN, "a request names another host", WRONG_HOST)
        ours = [[f"{scheme}://{hosts[0]}"] for scheme in self._schemes]
        if (origins or request.path == SOCKET) and origins not in ours:
            return Refusal(http.HTTPStatus.FORBIDDEN, "a request has another origin", WRONG_ORIGIN)
        if request.path.startswith(RECORDS) and not self._has_token(request):
            return Refusal(http.HTTPStatus.FORBIDDEN, "a request has no token")
        if request.method != "GET":
            return Refusal(http.HTTPStatus.METHOD_NOT_ALLOWED, "a request is no GET")
        return None

    def _has_token(self, request: Request) -> bool:
        found = request.headers.get_all("Authorization")
        return len(found) == 1 and self.is_token(found[0].removeprefix("Bearer "))

    def file(self, path: str) -> Response:
        if path in self._files:
            return respond(http.HTTPStatus.OK, *self._files[path])
        return respond(http.HTTPStatus.NOT_FOUND)


def is_direct(request: Request) -> bool:
    """Return whether a request to this machine has come from it, and not by a proxy."""
    is_forwarded = any(it == "forwarded" or it.startswith("x-forwarded-") for it in request.headers)
    return not is_forwarded and all(_is_loopback(_without_port(it)) for it in request.headers.get_all("Host"))


def respond(status: http.HTTPStatus, kind: str = "text/plain; charset=utf-8", body: bytes = b"") -> Response:
    """Return a response with the headers of every response; without a body its text is that of the status."""
    body = body or f"{status.phrase}\n".encode()
    headers = Headers(SECURITY_HEADERS)
    headers.update(
        {
            "Date": formatdate(usegmt=True),
            "Connection": "close",
            "Content-Length": str(len(body)),
            "Content-Type": kind,
        }
    )
    if status is http.HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = "GET"
    return Response(status.value, status.phrase, headers, body)


def _without_port(host: str) -> str:
    """Return the name in a ``Host`` header; empty if there is none."""
    found = _HOST.fullmatch(host)
    return found[1] if found else ""


def _is_loopback(name: str) -> bool:
    try:
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False
