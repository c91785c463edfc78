"""Programs that tests of the replay run."""

from __future__ import annotations

import os
import signal
import sys
import time
from importlib import import_module
from typing import Any

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Scale(Node):
    """Multiplies points by a latched factor, and says when each came by the node's clock."""

    def __init__(self) -> None:
        super().__init__("scale")
        self.declare_parameter("offset", 0.0)
        self._factor = 0.0
        self._scaled = self.create_publisher(PointStamped, "scaled", 10)
        self._times = self.create_publisher(Float64, "times", 10)
        self.create_publisher(String, "ready", LATCHED).publish(String(data="ready"))
        self.create_subscription(String, "factor", self._set, LATCHED)
        self.create_subscription(PointStamped, "point", self._scale, 10)

    def _set(self, message: String) -> None:
        self._factor = float(message.data)

    def _scale(self, message: PointStamped) -> None:
        message.point.x = message.point.x * self._factor + self.get_parameter("offset").value
        self._scaled.publish(message)
        self._times.publish(Float64(data=self.get_clock().now().nanoseconds / 1e9))


def scale() -> None:
    rclpy.init()
    try:
        rclpy.spin(Scale())
    except (KeyboardInterrupt, ExternalShutdownException):
        print("interrupted")


def relay() -> None:
    """Say again what ``scaled`` says."""
    rclpy.init()
    node = rclpy.create_node("relay")
    again = node.create_publisher(PointStamped, "again", 10)
    node.create_subscription(PointStamped, "scaled", again.publish, 10)
    rclpy.spin(node)


def fail() -> None:
    rclpy.init()
    node = rclpy.create_node("fail")

    def give_up(message: Any) -> None:
        raise RuntimeError("no point")

    node.create_subscription(PointStamped, "point", give_up, 10)
    rclpy.spin(node)


def import_missing() -> None:
    import_module("tf2_nothing.buffer")


def wait() -> None:
    """Wait for a service."""
    rclpy.init()
    node = rclpy.create_node("waiting", namespace="/deep")
    node.create_client(SetBool, "power").wait_for_service()


def stay() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        time.sleep(1.0)


def publish_late() -> None:
    """Begin to publish points, a second after the beginning of the record."""
    rclpy.init()
    node = rclpy.create_node("late")
    time.sleep(3.0)
    node.create_publisher(PointStamped, "point", 10)
    rclpy.spin(node)


if __name__ == "__main__":
    print(sys.argv)
    scale()


def show_environment() -> None:
    print(dict(os.environ))


def hear_transforms() -> None:
    from tf2_msgs.msg import TFMessage

    rclpy.init()
    node = rclpy.create_node("frames")
    frames = node.create_publisher(String, "frames", 10)

    def hear(message: Any) -> None:
        frames.publish(String(data=message.transforms[0].child_frame_id))

    node.create_subscription(TFMessage, "/tf", hear, 10)
    rclpy.spin(node)
