"""What simulated programs cannot do: it is refused by name, and never done for real."""

from __future__ import annotations

import importlib
import os
import select
import signal
import socket
import subprocess
from contextlib import suppress
from typing import Any

from rclpy_simulation.process import here

_REFUSED: list[tuple[Any, str]] = [
    (os, "fork"),
    (os, "posix_spawn"),
    (os, "system"),
    (select, "epoll"),
    (select, "poll"),
    (signal, "alarm"),
    (signal, "pause"),
    (signal, "setitimer"),
    (signal, "sigwait"),
    (signal, "sigtimedwait"),
    (socket, "getaddrinfo"),
    (socket, "gethostbyname"),
    (socket, "socketpair"),
    *((socket.socket, name) for name in ("accept", "connect", "connect_ex")),
    *((socket.socket, name) for name in ("recv", "recv_into", "recvfrom", "send", "sendall", "sendto")),
    (subprocess.Popen, "__init__"),
]
with suppress(ImportError):  # not every Python has them
    _REFUSED.append((importlib.import_module("curses"), "initscr"))
with suppress(ImportError):
    _REFUSED.append((importlib.import_module("tkinter").Tk, "__init__"))


class NotSimulatedError(RuntimeError):
    """A simulated program has asked for something that only reality has."""

    def __init__(self, what: str) -> None:
        super().__init__(f"rclpy_simulation does not simulate {what}")


def _refusal(owner: Any, name: str, real: Any) -> Any:
    place = f"{owner.__module__}.{owner.__name__}" if isinstance(owner, type) else owner.__name__
    what = place if name == "__init__" else f"{place}.{name}"

    def call(*arguments: Any, **options: Any) -> Any:
        if here.process is None or (arguments and _asks_the_kernel(arguments[0])):
            return real(*arguments, **options)
        raise NotSimulatedError(what)

    return call


def _asks_the_kernel(owner: Any) -> bool:
    return isinstance(owner, socket.socket) and owner.family == socket.AF_NETLINK


def replacements() -> list[tuple[Any, str, Any]]:
    return [(owner, name, _refusal(owner, name, getattr(owner, name))) for owner, name in _REFUSED]
