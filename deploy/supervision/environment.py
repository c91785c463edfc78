"""The environment of an arm's processes."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from deploy.supervision import manifest, processes, rclpy_choice, variables
from deploy.supervision.run_directory import ROS_LOGS
from interfaces import arm_variables

NAMESPACE = arm_variables.NAMESPACE
SECURITY = "ROS_SECURITY_ENABLE"
"""Environment variable of ROS 2: whether DDS is secured."""
STRATEGY, ENFORCE = "ROS_SECURITY_STRATEGY", "Enforce"
"""Environment variable of ROS 2, and the value with which nothing joins without keys."""
KEYSTORE = "ROS_SECURITY_KEYSTORE"
"""Environment variable of ROS 2: the folder of the keystore."""
OVERRIDE = "ROS_SECURITY_ENCLAVE_OVERRIDE"
"""Environment variable of ROS 2: the enclave of all processes."""
_NAMES = (
    rclpy_choice.RUNTIME,
    "PYTHONPATH",
    "LD_LIBRARY_PATH",
    "AMENT_PREFIX_PATH",
    NAMESPACE,
    manifest.VARIABLE,
    manifest.HOST,
)
_BEGINNINGS = ("ROS_", "RMW_", "CYCLONEDDS_", "FASTRTPS_", "FASTDDS_")
FASTDDS_PROFILES = Path(__file__).resolve().parents[1] / "fastdds.xml"
CYCLONEDDS = "CYCLONEDDS_URI"
RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
# Processes of one tag find each other by multicast, so they need neither questions to each port nor a port of
# their own, of which a domain has a hundred.
_BY_MULTICAST = (
    '<General><Interfaces><NetworkInterface name="lo" multicast="true" allow_multicast="spdp"/></Interfaces>'
    "<AllowMulticast>spdp</AllowMulticast></General>"
)
_WITHOUT_INDEX = (
    "<ParticipantIndex>none</ParticipantIndex><MaxAutoParticipantIndex>0</MaxAutoParticipantIndex>"
)


def is_adopted(name: str) -> bool:
    """Whether a variable belongs to an arm: other commands for it take it over."""
    return name in _NAMES or name.startswith(_BEGINNINGS)


def is_secured(environment: Mapping[str, str]) -> bool:
    """Whether DDS is secured in an environment; no other spelling counts, as in ROS 2."""
    return environment.get(SECURITY) == "true"


def set_middleware(environment: MutableMapping[str, str]) -> None:
    """Set what the nodes of an arm need from the middleware, where the user has not set it."""
    if environment.pop("ROS_LOCALHOST_ONLY", "") == "1":  # then rcl ignores both of these, and Fast DDS ours
        environment[RANGE] = "LOCALHOST"
        environment.pop(PEERS, None)
    own = {
        RANGE: "LOCALHOST",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(FASTDDS_PROFILES),
        # In LOCALHOST, rmw_fastrtps_cpp adds shared memory all the same; there, the profile keeps it out.
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }
    for name, value in own.items():
        environment[name] = environment.get(name) or value  # an empty one would open the arm to the subnet
    if is_secured(environment):
        environment.setdefault(STRATEGY, ENFORCE)
    elif environment.get(rclpy_choice.RUNTIME) and namespace_of(environment) != "/":
        # Not with keys: of the tagged arms in a domain, `make fleet` could join only one, because permissions
        # name the number that a domain has within the process. And version 0.10 does not know _BY_MULTICAST.
        environment.setdefault(CYCLONEDDS, tagged(environment))
    environment.pop(OVERRIDE, None)  # it is for `ros2` in the same shell: processes of an arm name theirs


def tagged(environment: Mapping[str, str]) -> str:
    """Return the settings of Cyclone DDS with which an arm meets no process of another arm in its domain.

    In a domain of many processes, each answers all others, and a busy machine repeats what is not answered.
    """
    general, index = (_BY_MULTICAST, _WITHOUT_INDEX) if is_alone(environment) else ("", "")
    discovery = f"<Discovery>{index}<Tag>{namespace_of(environment)}</Tag></Discovery>"
    return f"<CycloneDDS><Domain>{general}{discovery}</Domain></CycloneDDS>"


def is_alone(environment: Mapping[str, str]) -> bool:
    """Whether no message of another host comes to the nodes of an environment."""
    return environment.get(RANGE) == "LOCALHOST" and not environment.get(PEERS)


def namespace_of(environment: Mapping[str, str]) -> str:
    """The ROS namespace of the arm in an environment."""
    return environment.get(NAMESPACE) or "/"


def of_supervisord(environment: Mapping[str, str], run: Path) -> dict[str, str]:
    """The environment of supervisord and its programs, from that of the command that starts them."""
    result = dict(environment)
    set_middleware(result)
    result = variables.kept(result)
    result[processes.MARK] = str(run)
    result[NAMESPACE] = namespace_of(result)
    result["ROS_LOG_DIR"] = str(run / ROS_LOGS)
    result["PYTHONUNBUFFERED"] = "1"
    result["OPENBLAS_NUM_THREADS"] = "1"  # numpy starts no threads: supervisord forks
    _prepend(result, "PATH", str(Path(sys.executable).parent))
    _prepend(result, "PYTHONPATH", str(processes.ROOT))
    return result


def _prepend(environment: dict[str, str], name: str, path: str) -> None:
    rest = environment.get(name)
    environment[name] = f"{path}{os.pathsep}{rest}" if rest else path
