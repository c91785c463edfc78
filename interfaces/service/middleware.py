"""Keeps Fast DDS from shared memory, which a killed process leaves behind."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

from interfaces.loopback import LOOPBACK_DOWN, loopback_is_up

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


@contextmanager
def without_shared_memory() -> Iterator[None]:
    """Initialize rclpy and create its first node in this ``with``; child processes inherit no change."""
    changes = settings()
    before = {name: os.environ[name] for name in changes}
    os.environ |= changes
    try:
        yield
    finally:
        os.environ |= before


def settings() -> dict[str, str]:
    """Return the environment that keeps Fast DDS on this machine without shared memory, which LOCALHOST adds.

    The settings are in ``NAME.localhost.xml`` next to ``NAME.xml``, the profiles file of the environment;
    without that file, nothing changes.

    :raises RuntimeError: if there is no way to other processes: the node would hear nobody.
    """
    if os.environ.get(RANGE, "").upper() != "LOCALHOST" or os.environ.get(PEERS):
        return {}
    if not loopback_is_up():
        raise RuntimeError(LOOPBACK_DOWN)
    if get_rmw_implementation_identifier() != "rmw_fastrtps_cpp":
        return {}
    local = f"{os.environ.get(PROFILES, '').removesuffix('.xml').removesuffix('.localhost')}.localhost.xml"
    if not Path(local).is_file():
        return {}
    return {RANGE: "SYSTEM_DEFAULT", PROFILES: local}  # the range is in the profile
