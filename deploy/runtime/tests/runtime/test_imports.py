"""Programs load only what they need: anything else would cost each of them time and memory."""

from __future__ import annotations

import subprocess
import sys

import pytest

SPIN = """
import rclpy
rclpy.init()
node = rclpy.create_node("node")
node.create_timer(0.0, lambda: None)
rclpy.spin_once(node, timeout_sec=10)
"""
ACTION = """
import rclpy
from example_interfaces.action import Fibonacci
from rclpy.action import ActionClient, ActionServer
rclpy.init()
node = rclpy.create_node("node")
def execute(goal_handle):
    goal_handle.succeed()
    return Fibonacci.Result()
server = ActionServer(node, Fibonacci, "fibonacci", execute)
client = ActionClient(node, Fibonacci, "fibonacci")
assert client.wait_for_server(timeout_sec=10)
future = client.send_goal_async(Fibonacci.Goal())
rclpy.spin_until_future_complete(node, future, timeout_sec=10)
future = future.result().get_result_async()
rclpy.spin_until_future_complete(node, future, timeout_sec=10)
assert future.result().status == 4
"""
NUMBERS = """
from rmw_dds_common.msg import Gid
from sensor_msgs.msg import Imu
Imu._deserialize(Imu._serialize(Imu()))
Gid._serialize(Gid(data=bytes(16)))
"""


@pytest.mark.parametrize(
    ("program", "unneeded"),
    [
        ("import rclpy.node", ("numpy", "rclpy.action", "action_msgs", "rclpy.lifecycle", "lifecycle_msgs")),
        (SPIN, ("numpy", "rclpy.action", "action_msgs", "rclpy._wait_set")),
        (ACTION, ("numpy",)),
        (NUMBERS, ("numpy",)),
    ],
    ids=["import", "spin", "action", "numbers"],
)
def test_programs_load_only_what_they_need(program: str, unneeded: tuple[str, ...], domain_id: int) -> None:
    program += "\nimport sys\nprint(*sys.modules)"
    loaded = subprocess.check_output([sys.executable, "-c", program], text=True, timeout=60).split()
    assert [name for name in loaded if name.startswith(unneeded)] == []
