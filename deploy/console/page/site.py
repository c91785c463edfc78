"""The files of the page over HTTP, and which requests are refused."""

from __future__ import annotations

import hmac
import http
from email.utils import formatdate
from pathlib import Path
from typing import NamedTuple

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

SOCKET = "/socket"
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


class Refusal(NamedTuple):
    """Why a request is outside the protocol."""

    status: http.HTTPStatus
    reason: str


class Site:
    """The files of the page, for clients that know its token and come by an accepted name."""

    def __init__(
        self, token: str, names: tuple[str, ...], scheme: str = "http", folder: Path = STATIC
    ) -> None:
        """
        Read the files: there are no others.

        :param names: the accepted ``Host`` headers, port included.
        :param scheme: ``http`` or ``https``.
        """
        self._token = token.encode()
        self._names = names
        self._origins = tuple(f"{scheme}://{name}" for name in names)
        files = {f"/static/{path.name}": (TYPES[path.suffix], path.read_bytes()) for path in folder.iterdir()}
        self._files = {"/": files[f"/static/{INDEX}"], **files}

    def is_token(self, text: str) -> bool:
        """Return whether a text is the token, in a time that tells nothing about it."""
        return hmac.compare_digest(text.encode(), self._token)

    def refusal(self, request: Request) -> Refusal | None:
        """Return why a request is refused, ``None`` if it is not."""
        origins = request.headers.get_all("Origin")
        if not _is_one_of(request.headers.get_all("Host"), self._names):
            return Refusal(http.HTTPStatus.FORBIDDEN, "a request names another host")
        if (origins or request.path == SOCKET) and not _is_one_of(origins, self._origins):
            return Refusal(http.HTTPStatus.FORBIDDEN, "a request has another origin")
        if request.method != "GET":
            return Refusal(http.HTTPStatus.METHOD_NOT_ALLOWED, "a request is no GET")
        return None

    def file(self, path: str) -> Response:
        """Return the response to a request for a path."""
        if path in self._files:
            return respond(http.HTTPStatus.OK, *self._files[path])
        return respond(http.HTTPStatus.NOT_FOUND)


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


def _is_one_of(values: list[str], known: tuple[str, ...]) -> bool:
    return len(values) == 1 and values[0] in known
