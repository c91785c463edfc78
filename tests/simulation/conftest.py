"""The simulation replaces the DDS of deploy/runtime. A sourced ROS 2 has another one."""

from __future__ import annotations

import importlib.util

collect_ignore_glob = [] if importlib.util.find_spec("rclpy_simulation") else ["test_*"]
