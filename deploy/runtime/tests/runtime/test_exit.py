"""The end of a node; and interpreter exit while one works, where ROS 2's rclpy aborts."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

from std_msgs.msg import Float64

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


READER = """
import time
import rclpy
from std_msgs.msg import Float64

rclpy.init(args=[])
node = rclpy.create_node("reader")
for topic in "abcd":
    node.create_subscription(Float64, topic, print, 10)
time.sleep(60)
"""


def test_a_node_ends_soon_though_a_reader_hangs(make_node: MakeNode, spin_until: SpinUntil) -> None:
    node = make_node("writer")
    publishers = [node.create_publisher(Float64, topic, 10) for topic in "abcd"]
    with subprocess.Popen([sys.executable, "-c", READER]) as reader:
        try:
            spin_until(lambda: all(each.get_subscription_count() for each in publishers))
            reader.send_signal(signal.SIGSTOP)
            for each in publishers:
                each.publish(Float64())
            begin = time.monotonic()
            node.destroy_node()
            assert time.monotonic() - begin < 2.0  # with Cyclone's settings, four seconds
        finally:
            reader.kill()
