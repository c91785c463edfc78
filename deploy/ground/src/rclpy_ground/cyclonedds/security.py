"""DDS Security: the environment variables of SROS2 choose the keys with which a process joins.

Sources: rcl for the variables and files, rmw_cyclonedds_cpp for the properties of the participant. Unlike
ROS 2, this ground takes ROS_SECURITY_STRATEGY for Enforce, whatever it says: nothing joins without its keys.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from rclpy_ground.genuine import RCLError

ENABLE = "ROS_SECURITY_ENABLE"
KEYSTORE = "ROS_SECURITY_KEYSTORE"
OVERRIDE = "ROS_SECURITY_ENCLAVE_OVERRIDE"
LIBRARY = "CYCLONEDDS_LIBRARY"
"""Environment variable: the C library of a Cyclone DDS that was built with security."""
_DEBIAN = "/usr/lib/{}/libddsc.so.0debian"
_PLUGINS = {  # kind: (library, functions)
    "auth": ("libdds_security_auth.so", "authentication"),
    "access": ("libdds_security_ac.so", "access_control"),
    "crypto": ("libdds_security_crypto.so", "crypto"),
}
_FILES = {  # property: file of the enclave
    "auth.identity_ca": "identity_ca.cert.pem",
    "auth.identity_certificate": "cert.pem",
    "auth.private_key": "key.pem",
    "access.permissions_ca": "permissions_ca.cert.pem",
    "access.governance": "governance.p7s",
    "access.permissions": "permissions.p7s",
}

_MEETING_PEERS = ("dq.builtins", "fsm")  # Cyclone's threads that discover peers and authenticate them
_REST = 0.05  # s
_JOINED = 1.0  # s after which all peers that were there are usually known
_NICENESS = 10


def is_wanted(environment: Mapping[str, str]) -> bool:
    """Whether the environment asks for security; no other spelling counts, as in ROS 2."""
    return environment.get(ENABLE) == "true"


def library(environment: Mapping[str, str]) -> Path | None:
    """Return the Cyclone DDS with security that is named, else Debian's; ``None`` without one."""
    named = environment.get(LIBRARY)
    found = Path(named) if named else Path(_DEBIAN.format(f"{os.uname().machine}-linux-gnu"))
    return found if found.is_file() and plugins_of(found) else None


def check(environment: Mapping[str, str]) -> None:
    """Raise RCLError if the environment asks for security that cannot be had."""
    if is_wanted(environment) and library(environment) is None:
        where = f"{LIBRARY}={environment[LIBRARY]} is none" if environment.get(LIBRARY) else "there is none"
        raise RCLError(
            f"{ENABLE} is true, which needs a Cyclone DDS with security, but {where}:"
            " apt-get install libddsc0t64 (on Debian 12, libddsc0debian),"
            f" name another one in {LIBRARY}, or source an installed ROS 2"
        )


def properties(enclave: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Return the DDS properties of a participant; none if the environment asks for no security.

    :param enclave: its name, from the command line.
    :raises RCLError: if the library or a file of the enclave is missing.
    """
    if not is_wanted(environment):
        return {}
    check(environment)
    found = library(environment)
    assert found is not None
    plugins = plugins_of(found)
    assert plugins is not None
    folder = _folder(enclave, environment)
    result = {}
    for name, file in _FILES.items():
        if not (folder / file).is_file():
            hint = f": name an enclave in {OVERRIDE}" if folder.name == "enclaves" else ""
            raise RCLError(f"{ENABLE} is true, but there is no {folder / file}{hint}")
        result[f"dds.sec.{name}"] = f"file:{folder / file}"
    for kind, (file, functions) in _PLUGINS.items():
        result[f"dds.sec.{kind}.library.path"] = str(plugins / file)
        result[f"dds.sec.{kind}.library.init"] = f"init_{functions}"
        result[f"dds.sec.{kind}.library.finalize"] = f"finalize_{functions}"
    return result


def give_way() -> None:
    """Make the threads of a new participant and of its peers run in an order in which they meet at once.

    A peer sends its first message 10 ms after it has discovered the participant. If that does not know the
    peer yet, it drops the message, and Cyclone repeats it only after a second. So a process that joins must
    be faster than its peers: its other threads rest, and those of the peers have a lower priority.
    """
    lower = threading.Timer(_JOINED, _lower_priority)
    lower.daemon = True
    lower.start()
    time.sleep(_REST)


def _lower_priority() -> None:
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):  # the thread has ended
            if (task / "comm").read_text().strip() in _MEETING_PEERS:
                os.setpriority(os.PRIO_PROCESS, int(task.name), _NICENESS)


def _folder(enclave: str, environment: Mapping[str, str]) -> Path:
    keystore = environment.get(KEYSTORE)
    if not keystore:
        raise RCLError(f"{ENABLE} is true, but {KEYSTORE} names no keystore")
    enclave = environment.get(OVERRIDE) or enclave
    return Path(keystore).resolve() / "enclaves" / enclave.lstrip("/")


def plugins_of(found: Path) -> Path | None:
    """Return the folder of a library's plugins: its own, or a folder beside it, as in Debian."""
    folders = (found.parent, *sorted(found.parent.glob("libddsc*/")))
    return next((it for it in folders if all((it / file).is_file() for file, _ in _PLUGINS.values())), None)
