"""Limits the memory that a request for parameters takes while rclpy deserializes it.

rclpy hands over no request without deserializing it. One of 4 MB that lies about the length of its sequence
of parameters would take 1.1 GB. Without memory for the sequence, the middleware drops the request.
"""

from __future__ import annotations

import resource
import threading

ROOM = 64 * 2**20  # octets: what a request may take beyond what the process has
_PAGE = resource.getpagesize()
_lock = threading.Lock()
_before: tuple[int, int] | None = None  # the limits of the process, while the room is limited


def limit() -> None:
    """Limit the memory of this process to what it has and the room for a request, until :func:`free`."""
    global _before
    with _lock:
        soft, hard = _before = _before or resource.getrlimit(resource.RLIMIT_DATA)
        most = _data() + ROOM
        if soft == resource.RLIM_INFINITY or most < soft:
            resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def free() -> None:
    """Restore the limit that the process had."""
    global _before
    if _before is None:  # the path of each turn
        return
    with _lock:
        if _before is not None:
            resource.setrlimit(resource.RLIMIT_DATA, _before)
            _before = None


def _data() -> int:
    """Return the size of the private memory that this process can write to, in octets (proc_pid_statm(5))."""
    with open("/proc/self/statm", "rb") as file:
        return int(file.read().split()[5]) * _PAGE
