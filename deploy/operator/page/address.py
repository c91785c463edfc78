"""Where the page listens, and the line that shows its address to the user."""

from __future__ import annotations

import errno
import ipaddress
import os
import re
import secrets
import socket
import ssl
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from deploy.supervision.run_directory import PAGE_FILE
from interfaces.service import UserError

DEFAULT_PORT = 8642
PORTS = 20  # that are tried from the default port on
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_LINE = re.compile(r"The page: https?://\S+:(\d+)/#(\S+)\n")


def listen(address: str, port: int, last_port: int | None = None) -> socket.socket:
    """Return a socket that listens on a port, the default port or one of the next if that is taken.

    :param last_port: the port of the last process: an open page looks for its successor there.
    :raises OSError: if it cannot listen; the message is for the user.
    """
    ports = list(range(DEFAULT_PORT, DEFAULT_PORT + PORTS)) if port == DEFAULT_PORT else [port]
    for candidate in (last_port, *ports) if last_port else ports:
        try:
            return socket.create_server((address, candidate), backlog=socket.SOMAXCONN)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise OSError(f"{address} port {candidate}: {error.strerror}") from None
    last = f" to {ports[-1]}" if len(ports) > 1 else ""
    raise OSError(f"port {ports[0]}{last} of {address} is taken: choose another one with WEB=<port>")


def tls(address: str, certificate: str, key: str) -> ssl.SSLContext | None:
    """Return the page's TLS context, ``None`` for HTTP. Raises UserError for a bad file, or missing TLS."""
    try:
        is_loopback = ipaddress.IPv4Address(address).is_loopback
    except ValueError:
        raise UserError(f"address: {address!r} is not an IPv4 address") from None
    if not certificate and not key:
        if is_loopback:
            return None
        raise UserError(f"address: {address} is not loopback and needs TLS: set certificate and key")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key or None, password="")  # instead of asking for one
    except OSError as error:  # or an SSLError, which names no file
        files = f"certificate {certificate!r}" + (f" or key {key!r}" if key else "")
        raise UserError(f"{files}: {error.strerror or error}") from None
    return context


def host_names(address: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names by which browsers reach the page, without a port.

    :raises UserError: if no browser sends one of them.
    """
    if not names and ipaddress.IPv4Address(address).is_unspecified:
        raise UserError(f"names: must be the names of this machine in browsers, as its address is {address}")
    for name in names:
        if not _NAME.fullmatch(name):
            characters = "ASCII letters, digits, dots, hyphens and underscores"
            raise UserError(f"names: {name!r} must consist of {characters}")
    return tuple(names or (("127.0.0.1", "localhost") if address == "127.0.0.1" else (address,)))


class AddressFile:
    """The line for the user, in the folder of what is kept until the next start of the system.

    A process that is restarted keeps port and token, so that an open page finds it again.
    """

    def __init__(self, folder: str) -> None:
        """:param folder: empty if nothing is kept."""
        self._path = Path(folder) / PAGE_FILE if folder else None

    def read(self) -> tuple[int | None, str]:
        """Return the port of the last process, if it is known, and the token."""
        try:
            line = self._path.read_text(encoding="ascii") if self._path else ""
        except (OSError, ValueError):
            line = ""
        found = _LINE.fullmatch(line)
        return (int(found[1]), found[2]) if found else (None, secrets.token_urlsafe(32))

    def write(self, line: str) -> None:
        """Keep a line, readable by the user only. Raises UserError if that is not possible."""
        if self._path is None:
            return
        with suppress(OSError):
            if self._path.read_bytes() == f"{line}\n".encode():
                return
        new = self._path.with_suffix(".new")
        try:
            self._path.parent.mkdir(mode=0o700, exist_ok=True)
            new.unlink(missing_ok=True)
            descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with open(descriptor, "w", encoding="ascii") as file:
                file.write(f"{line}\n")
            os.replace(new, self._path)
        except OSError as error:
            raise UserError(f"{self._path}: {error.strerror}") from error
