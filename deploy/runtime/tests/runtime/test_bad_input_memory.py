from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path

from rclpy._dds import Participant
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64

SpinUntil = Callable[..., None]
TRUNCATED = b"\0\1\0\0\1"


def resident() -> int:
    """Return the resident memory of this process [octets] (proc(5))."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def test_malformed_samples_leave_no_memory_behind(
    node: Node, participant: Participant, spin_until: SpinUntil
) -> None:
    qos = QoSProfile(depth=1000)
    subscription = node.create_subscription(Float64, "x", lambda _: None, qos)
    writer = participant.create_writer("rt/x", "std_msgs::msg::dds_::Float64_", qos, "")
    spin_until(writer.matched)

    def drop(count: int) -> None:
        done = subscription._rclpy_bad_input.count + count
        for _ in range(count):
            writer.write(TRUNCATED)
        spin_until(lambda: subscription._rclpy_bad_input.count == done)

    drop(100)  # buffers grow once
    before = resident()
    for _ in range(10):
        drop(50)

    assert resident() - before < 20e6  # of 500 samples
