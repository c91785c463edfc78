"""Ports of TCP for programs of the tests."""

from __future__ import annotations

import os
import random
import socket

FROM, TO = 20_000, 32_000  # below those that the kernel gives by itself
_random = random.Random(os.getpid())  # other workers of pytest-xdist draw others


def free_port() -> int:
    """Return a port of 127.0.0.1 that no other program is given by chance."""
    while True:
        port = _random.randrange(FROM, TO)
        try:
            with socket.create_server(("127.0.0.1", port)):
                return port
        except OSError:  # of another program
            continue
