"""The arm in virtual time: its real services, a simulated supervisor, network and operator, and faults."""

import importlib.util
import sys

if importlib.util.find_spec("rclpy_simulation") is None:
    sys.exit("A simulation needs the rclpy of deploy/runtime: use a terminal in which no ROS 2 is sourced")
