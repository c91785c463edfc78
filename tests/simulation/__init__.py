"""The arm in virtual time: its real services, a simulated supervisor, network and operator, and faults."""

import sys

try:
    import rclpy_simulation  # noqa: F401 (first: it chooses the ground of rclpy)
except ImportError as error:
    sys.exit(f"A simulation cannot run here: {error}")
