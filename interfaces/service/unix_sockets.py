"""The abstract unix sockets of this network namespace, and who has bound them: sock_diag(7).

A process may bind any such address, but cannot hide its user.
"""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from interfaces.seam import replaceable

_SOCK_DIAG, _BY_FAMILY, _REQUEST_DUMP = 4, 20, 0x301
_ERROR, _DONE = 2, 3
_HEADER = struct.Struct("=IHHII")  # struct nlmsghdr
_ALL = 0xFFFFFFFF
_SHOWN = 0x01 | 0x40  # UDIAG_SHOW_NAME, UDIAG_SHOW_UID
_REQUEST = struct.pack("=BBHIIIII", socket.AF_UNIX, 0, 0, _ALL, 0, _SHOWN, _ALL, _ALL)  # struct unix_diag_req
_REPLY = 16  # octets of a struct unix_diag_msg
_ATTRIBUTE = struct.Struct("=HH")  # struct nlattr
_NAME, _USER = 0, 7  # UNIX_DIAG_NAME, UNIX_DIAG_UID


@replaceable
def bind(address: str) -> socket.socket:
    """Return a socket with an abstract address; raise OSError if another one has it."""
    bound = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        bound.bind(f"\0{address}")
    except OSError:
        bound.close()
        raise
    return bound


@replaceable
def owners(prefix: str) -> dict[str, int]:
    """Return the abstract addresses with a beginning, and the users who have bound them.

    Where the kernel does not show the users (before Linux 5.3, or without sock_diag), all of them are ours.
    """
    begin = b"\0" + prefix.encode()
    found = _from_the_kernel() or _from_the_table()
    return {name[1:].decode(errors="replace"): user for name, user in found if name.startswith(begin)}


def _from_the_kernel() -> list[tuple[bytes, int]]:
    found: list[tuple[bytes, int]] = []
    with suppress(OSError), socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _SOCK_DIAG) as kernel:
        kernel.send(_HEADER.pack(_HEADER.size + len(_REQUEST), _BY_FAMILY, _REQUEST_DUMP, 0, 0) + _REQUEST)
        while True:
            for kind, message in _messages(kernel.recv(1 << 16)):
                if kind in (_ERROR, _DONE):
                    return found if kind == _DONE else []
                attributes = dict(_attributes(message[_REPLY:]))
                user = attributes.get(_USER, struct.pack("=I", os.geteuid()))
                found.append((attributes.get(_NAME, b""), *struct.unpack("=I", user)))
    return []


def _messages(data: bytes) -> Iterator[tuple[int, bytes]]:
    while data:
        length, kind, *_ = _HEADER.unpack_from(data)
        yield kind, data[_HEADER.size : length]
        data = data[_aligned(length) :]


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    while data:
        length, kind = _ATTRIBUTE.unpack_from(data)
        yield kind, data[_ATTRIBUTE.size : length]
        data = data[_aligned(length) :]


def _aligned(length: int) -> int:
    return (length + 3) & ~3


def _from_the_table() -> list[tuple[bytes, int]]:
    names = (line.split(maxsplit=7)[7:] for line in Path("/proc/net/unix").read_bytes().splitlines())
    return [(b"\0" + name[1:], os.geteuid()) for (name,) in filter(None, names) if name.startswith(b"@")]
