"""Keeps Fast DDS from shared memory, which a killed process leaves behind."""

from __future__ import annotations

import os
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def avoid_shared_memory() -> None:
    """
    Keep this process on this machine by settings of Fast DDS; ROS 2's LOCALHOST would add shared memory.

    Call this before ``rclpy.init()``. The settings are in ``NAME.localhost.xml`` next to ``NAME.xml``, the
    profiles file of the environment; without that file, nothing changes. Child processes inherit them.
    """
    profiles = os.environ.get(PROFILES, "")
    local = Path(f"{profiles.removesuffix('.xml').removesuffix('.localhost')}.localhost.xml")
    wants_localhost = os.environ.get(RANGE, "").upper() == "LOCALHOST" and not os.environ.get(PEERS)
    if wants_localhost and local.is_file() and get_rmw_implementation_identifier() == "rmw_fastrtps_cpp":
        os.environ[RANGE] = "SYSTEM_DEFAULT"  # as the profile says
        os.environ[PROFILES] = str(local)
