"""Interpreter exit while a node works, without rclpy.shutdown(); ROS 2's rclpy aborts there."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import threading
import rclpy
from std_msgs.msg import Float64

rclpy.init(args=[])
node = rclpy.create_node("node")
publisher = node.create_publisher(Float64, "x", 10)
begun = threading.Event()
node.create_timer(0.0001, lambda: (publisher.publish(Float64()), begun.set()))
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
begun.wait()
"""


@pytest.mark.parametrize("attempt", range(3))
def test_a_program_exits_cleanly_while_a_daemon_thread_spins(domain_id: int, attempt: int) -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
