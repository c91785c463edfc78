"""Calls of supervisord's XML-RPC interface."""

from __future__ import annotations

import http.client
import os
import socket
import struct
import xmlrpc.client
from typing import Any

LIMIT = 5.0  # s that supervisord has to answer, unless the caller says otherwise
_CREDENTIALS = struct.Struct("@iII")  # unix(7): pid, user, group


class NoAnswer(Exception):
    """supervisord does not answer, or answers with an error."""


def call(pid: int, method: str, *arguments: object, timeout: float = LIMIT) -> Any:
    """Call a method of the supervisord with this pid. Raises NoAnswer without one in time, or after an error.

    The call goes through its working directory: a unix socket's path has at most 107 bytes.

    :param timeout: for a supervisord that hangs [s].
    """
    transport = _UnixTransport(f"/proc/{pid}/cwd/supervisor.sock", timeout)
    try:
        with xmlrpc.client.ServerProxy("http://localhost", transport=transport) as server:
            return getattr(server, method)(*arguments)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
        raise NoAnswer(f"supervisord (pid {pid}) does not answer: {error}") from error


class _UnixConnection(http.client.HTTPConnection):
    def __init__(self, path: str, timeout: float) -> None:
        super().__init__("localhost")
        self._path = path
        self._limit = timeout

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self._limit)
        self.sock.connect(self._path)
        peer = self.sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        if _CREDENTIALS.unpack(peer)[1] != os.geteuid():  # its pid went to a process of another user
            raise PermissionError("it belongs to another user")


class _UnixTransport(xmlrpc.client.Transport):
    def __init__(self, path: str, timeout: float) -> None:
        super().__init__()
        self._unix_connection = _UnixConnection(path, timeout)

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        return self._unix_connection

    def close(self) -> None:
        self._unix_connection.close()
