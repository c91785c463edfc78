"""How the processes of an arm join: without Fast DDS's shared memory, which a killed process leaves behind.

And without ROS 2's log files in the user's home, which grow with each run: supervisord keeps an arm's logs.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

from interfaces.loopback import LOOPBACK_DOWN, loopback_is_up

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
WITHOUT_LOG_FILES = ("--ros-args", "--disable-external-lib-logs", "--")
"""Arguments of rclpy.init(); those that follow may ask for log files."""


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
    if not _is_local() or os.environ.get(PEERS):
        return {}
    if not loopback_is_up():
        raise RuntimeError(LOOPBACK_DOWN)
    if not is_fast_dds() or shared_memory():
        return {}
    return {RANGE: "SYSTEM_DEFAULT", PROFILES: str(_local_profiles())}  # the range is in the profile


def shared_memory() -> str:
    """Return what brings Fast DDS's shared memory back; empty if nothing does."""
    if not _is_local() or not is_fast_dds():
        return ""
    if os.environ.get(PEERS):
        return f"{PEERS} is set"
    return "" if _local_profiles().is_file() else f"there is no {_local_profiles()}"


def is_fast_dds() -> bool:
    identifier: str = get_rmw_implementation_identifier()
    return identifier == "rmw_fastrtps_cpp"


def _is_local() -> bool:
    return os.environ.get(RANGE, "").upper() == "LOCALHOST"


def _local_profiles() -> Path:
    name = os.environ.get(PROFILES, "").removesuffix(".xml").removesuffix(".localhost")
    return Path(f"{name}.localhost.xml")
