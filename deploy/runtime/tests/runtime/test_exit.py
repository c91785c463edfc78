"""The end of the interpreter while nodes work, without rclpy.shutdown(); ROS 2's own rclpy aborts there."""

from __future__ import annotations

import subprocess
import sys

import pytest

DAEMON = """
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
def test_the_end_of_a_program_in_which_a_daemon_thread_spins_is_no_crash(
    domain_id: int, attempt: int
) -> None:
    done = subprocess.run([sys.executable, "-c", DAEMON], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
