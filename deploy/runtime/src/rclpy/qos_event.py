"""The name of :mod:`rclpy.event_handler` before ROS 2 Iron."""

import warnings

from rclpy.event_handler import *  # noqa: F403

warnings.warn("rclpy.qos_event is deprecated: import rclpy.event_handler instead", stacklevel=2)
