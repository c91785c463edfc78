"""Keeps the processors awake while something is measured.

An idle processor, a virtual one above all, takes so long to wake that this is most of a round trip and of a
timer's share, and the same for whoever is measured. What an rclpy itself costs shows where none sleeps.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

# It gives way to everything else, keeps to a processor of its own, and ends with who started it.
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
    """Let no processor sleep within the block."""
    with ExitStack() as stack:
        for processor in os.sched_getaffinity(0):
            command = [sys.executable, "-c", _SPIN, str(processor), str(os.getpid())]
            spinner = stack.enter_context(subprocess.Popen(command))
            stack.callback(spinner.kill)
        yield
