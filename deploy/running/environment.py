"""The environment of an arm's processes."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from deploy.running import manifest, processes

NAMESPACE = "REACTIVE_ARM_NAMESPACE"  # environment variable: the ROS namespace of an arm
ADOPTED = (
    "RUNTIME",
    "PYTHONPATH",
    "LD_LIBRARY_PATH",
    "AMENT_PREFIX_PATH",
    "ROS_",
    "RMW_",
    "CYCLONEDDS_",
    "FASTRTPS_",
    "FASTDDS_",
    NAMESPACE,
    manifest.VARIABLE,
)
"""The beginnings of the variables that belong to an arm: other commands for it take them over."""
FASTDDS_PROFILES = Path(__file__).resolve().parents[1] / "fastdds.xml"


def set_middleware(environment: MutableMapping[str, str]) -> None:
    """Set what the nodes of an arm need from the middleware, where the user has not set it."""
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(FASTDDS_PROFILES))
    # In LOCALHOST, rmw_fastrtps_cpp always adds shared memory; there, the profile keeps messages out of it.
    environment.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")


def namespace_of(environment: Mapping[str, str]) -> str:
    """The ROS namespace of the arm in an environment."""
    return environment.get(NAMESPACE) or "/"


def of_supervisord(environment: Mapping[str, str], run: Path) -> dict[str, str]:
    """The environment of supervisord and its programs, from that of the command that starts them."""
    result = dict(environment)
    result[processes.MARK] = str(run)
    result[NAMESPACE] = namespace_of(result)
    set_middleware(result)
    result["PYTHONUNBUFFERED"] = "1"
    result["OPENBLAS_NUM_THREADS"] = "1"  # numpy starts no threads: supervisord forks
    _prepend(result, "PATH", str(Path(sys.executable).parent))
    _prepend(result, "PYTHONPATH", str(processes.ROOT))
    return result


def _prepend(environment: dict[str, str], name: str, path: str) -> None:
    rest = environment.get(name)
    environment[name] = f"{path}{os.pathsep}{rest}" if rest else path
