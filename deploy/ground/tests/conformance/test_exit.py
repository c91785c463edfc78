"""Use of rclpy while the interpreter exits, without rclpy.shutdown()."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import atexit
import rclpy
from std_msgs.msg import Float64

rclpy.init(args=[])

def publish():
    publisher.publish(Float64())
    node.get_logger().info("published")

atexit.register(publish)
node = rclpy.create_node("node")
publisher = node.create_publisher(Float64, "x", 10)
"""


def test_an_atexit_function_may_publish_and_log(domain_id: int) -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert "published" in done.stderr
    assert "Error" not in done.stderr
