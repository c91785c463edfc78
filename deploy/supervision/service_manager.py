"""Notifies systemd how the arm is: sd_notify(3)."""

from __future__ import annotations

import os
import socket
from contextlib import suppress

READY = "READY=1"
ALIVE = "WATCHDOG=1"
_ADDRESS = "NOTIFY_SOCKET"  # environment variable


def notify(state: str) -> None:
    """Send a state to the service manager that has started this system, if there is one; never block."""
    if address := os.environ.get(_ADDRESS, ""):
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            # A first "@" stands for the zero byte of an abstract address.
            sender.sendto(state.encode(), f"\0{address[1:]}" if address[0] == "@" else address)
