"""How a service ends: SIGTERM and Ctrl-C end it within a second, with exit code 0, whatever it is doing.

Before it spins nothing is worth waiting for: from :func:`prepare` on a signal ends the process on the spot.
From :func:`spinning` on, rclpy shuts down and the service winds up in order; but if that takes too long, or a
second signal comes, the process ends on the spot as well.
"""

from __future__ import annotations

import os
import signal
import threading
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
_PATIENCE = 0.8  # [s], of the second that a service has

_spins = False


def _end() -> None:
    os._exit(0)


def _handle(signum: int, frame: FrameType | None) -> None:
    global _spins
    if not _spins:
        _end()
    _spins = False
    last_resort = threading.Timer(_PATIENCE, _end)
    last_resort.daemon = True
    last_resort.start()


def prepare() -> None:
    """From now on this process is a service, and a signal ends it on the spot."""
    for number in SIGNALS:
        signal.signal(number, _handle)


def spinning() -> None:
    """From now on a signal lets the service wind up; rclpy has to handle signals by now."""
    global _spins
    _spins = True


def ending() -> None:
    """From now on a signal changes nothing: the process is about to end, with an exit code of its own."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
