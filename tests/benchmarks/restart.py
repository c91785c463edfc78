"""Kills a service of the arm of this environment; prints when the next one is heard [s after the kill]."""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from collections.abc import Mapping

import rclpy

from deploy.supervision import processes
from deploy.supervision.environment import namespace_of
from interfaces.service import middleware
from interfaces.service.health import Health, heard_healths
from reactive_node import ReactiveNode
from reactive_node.executor import create_executor

VICTIM = socket.gethostname(), "kinematics"
LIMIT = 10.0  # s


def main() -> int:
    """Kill the service once; return the exit code."""
    with middleware.without_shared_memory():
        rclpy.init(args=[])
        node = ReactiveNode(f"restart_{os.getpid()}", namespace=namespace_of(os.environ))
    executor = create_executor()
    executor.add_node(node)

    def other_than(pid: int, health: Mapping[tuple[str, str], Health]) -> Health:
        deadline = time.monotonic() + LIMIT
        while VICTIM not in health or health[VICTIM].pid == pid:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{VICTIM[1]} is not heard within {LIMIT:g} s")
            executor.spin_once(timeout_sec=0.1)
        return health[VICTIM]

    with heard_healths(node) as health:
        pid = other_than(0, health).pid
        processes.send_signal(processes.run_directory(), VICTIM[1], pid, signal.SIGKILL)
        killed = time.monotonic()
        print(other_than(pid, health).heard - killed)
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
