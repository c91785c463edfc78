"""Where the middlewares of ROS 2 differ."""

from __future__ import annotations

from rclpy.qos import HistoryPolicy
from rclpy.utilities import get_rmw_implementation_identifier

ANNOUNCES_HISTORY = get_rmw_implementation_identifier() != "rmw_fastrtps_cpp"
"""Whether other nodes learn the history of an endpoint."""


def announced_history(depth: int) -> tuple[HistoryPolicy, int]:
    """Return history and depth, as other nodes see them, of an endpoint that keeps the last messages."""
    return (HistoryPolicy.KEEP_LAST, depth) if ANNOUNCES_HISTORY else (HistoryPolicy.UNKNOWN, 0)
