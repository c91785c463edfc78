"""Keeps the processors awake during a measurement.

An idle processor, a virtual one above all, wakes so slowly that this is most of a round trip and of a timer's
CPU time, on every rclpy alike. With processors that never sleep, the costs of rclpy itself become visible.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

# Runs at idle priority, pinned to one processor, until its parent ends.
_SPIN = """
import os, sys
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
os.sched_setaffinity(0, {int(sys.argv[1])})
parent = int(sys.argv[2])
while os.getppid() == parent:
    for _ in range(100_000):
        pass
"""


@contextmanager
def processors_awake() -> Iterator[None]:
    """Keep every processor from sleeping within the block."""
    with ExitStack() as stack:
        for processor in os.sched_getaffinity(0):
            command = [sys.executable, "-c", _SPIN, str(processor), str(os.getpid())]
            spinner = stack.enter_context(subprocess.Popen(command))
            stack.callback(spinner.kill)
        yield
