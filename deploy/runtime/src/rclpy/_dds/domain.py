"""Joins DDS domains, with Cyclone DDS configured from the environment variables of ROS 2.

Source: ROS 2 Jazzy, "Improved dynamic discovery": ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_STATIC_PEERS,
ROS_LOCALHOST_ONLY (deprecated, still obeyed) and ROS_DOMAIN_ID. The settings of Cyclone's CYCLONEDDS_URI win.
"""

from __future__ import annotations

import os
import re
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from rclpy.exceptions import RCLError

from .library import PRECONDITION_NOT_MET, blocking, checked

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_NO_MULTICAST = "<General><AllowMulticast>false</AllowMulticast></General>"

_lock = threading.Lock()
_users: dict[int, int] = {}  # domain id -> number of participants of this process
_handles: dict[int, int] = {}


def domain_id_from_environment(environment: Mapping[str, str] = os.environ) -> int:
    """Return ROS_DOMAIN_ID, by default 0. Raises RCLError if it is not a number from 0 to 232."""
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > 232:
        raise RCLError(f"ROS_DOMAIN_ID must be a whole number from 0 to 232, not '{text}'")
    return int(text)


def configuration(environment: Mapping[str, str] = os.environ) -> str:
    """Return Cyclone's configuration for the discovery range in the environment. Raises RCLError.

    LOCALHOST uses the loopback interface only. With multicast on it, processes of this runtime discover each
    other at once. Jazzy nodes do not use multicast there: they probe participant indices on localhost. So
    this runtime takes an index and probes, too, for up to 100 processes; Jazzy's limit of 33 is too low for a
    fleet. Static peers may need other interfaces, so with peers the configuration is that of Jazzy.
    """
    discovery_range = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper() or "SUBNET"
    if discovery_range not in RANGES:
        raise RCLError(
            f"ROS_AUTOMATIC_DISCOVERY_RANGE must be one of {', '.join(RANGES)}, not '{discovery_range}'"
        )
    peers = [peer.strip() for peer in environment.get("ROS_STATIC_PEERS", "").split(";") if peer.strip()]
    if any(character in peer for peer in peers for character in "<>&\"'"):
        raise RCLError(f"ROS_STATIC_PEERS must be addresses or host names with ';' between, not {peers}")
    uri = environment.get("CYCLONEDDS_URI", "")
    if environment.get("ROS_LOCALHOST_ONLY", "0") == "1":
        discovery_range, peers = "LOCALHOST", []
    if discovery_range in ("LOCALHOST", "SUBNET"):
        peers = [peer for peer in peers if _has_address(peer, only_ipv4=not uri)]
    general, discovery = "", ""
    if discovery_range == "LOCALHOST":
        if peers:
            # With extended packet information, Cyclone would drop packets from interfaces that it does not
            # use, such as those that Jazzy nodes send to localhost.
            general = f"{_NO_MULTICAST}<Internal><ExtendedPacketInfo>false</ExtendedPacketInfo></Internal>"
        elif not _names_interfaces(uri):
            interface = '<NetworkInterface name="lo" multicast="true"/>'
            general = f"<General><Interfaces>{interface}</Interfaces></General>"
        peers = ["localhost", *peers]
    elif discovery_range == "OFF":
        general = _NO_MULTICAST
        tag = f"<Tag>ros_discovery_off_{os.getpid()}</Tag>"
        discovery = f"<Discovery><ParticipantIndex>none</ParticipantIndex>{tag}</Discovery>"
    if discovery_range in ("LOCALHOST", "SUBNET"):
        addresses = "".join(f'<Peer address="{peer}"/>' for peer in peers)
        discovery = (
            "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
            "<MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>"
            f"<Peers>{addresses}</Peers></Discovery>"
        )
    own = f"<CycloneDDS><Domain>{general}{discovery}</Domain></CycloneDDS>" if discovery else ""
    return ",".join(part for part in (own, uri) if part)


@cache
def _has_address(peer: str, only_ipv4: bool) -> bool:
    """Whether a peer's name can be resolved; print a warning if not.

    Cyclone would abort the process. But the other peers, or a restart without a network, must still work.
    """
    import socket  # imported on use: peers are rare, and it would slow down every start

    family = socket.AF_INET if only_ipv4 else socket.AF_UNSPEC
    try:
        socket.getaddrinfo(peer.partition(":")[0] if peer.count(":") == 1 else peer, None, family)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        print(f"[WARN] ROS_STATIC_PEERS: '{peer}' is ignored: {reason}", file=sys.stderr, flush=True)
        return False
    return True


def _names_interfaces(uri: str) -> bool:
    """Whether the settings of CYCLONEDDS_URI, inline or in files, name network interfaces.

    If so, only these must be used: Cyclone would add ours, and fail if one is named twice.
    """
    settings = [uri]
    for source in uri.split(","):
        with suppress(OSError):  # Cyclone reports unreadable files
            settings.append(Path(source.strip().removeprefix("file://")).read_text(errors="replace"))
    # Cyclone ignores case in names.
    return any("<networkinterface" in _COMMENT.sub("", text).lower() for text in settings)


def enter(domain_id: int) -> None:
    """Configure a domain before the first participant of this process."""
    with _lock:
        if not _users.get(domain_id):
            handle = blocking.dds_create_domain(domain_id, configuration().encode())
            # If other code in this process has created the domain, its configuration applies.
            if handle != PRECONDITION_NOT_MET:
                _handles[domain_id] = checked(handle, f"cannot configure DDS domain {domain_id}")
        _users[domain_id] = _users.get(domain_id, 0) + 1


def leave(domain_id: int) -> None:
    """Undo one ``enter``; the last call deletes the domain and ends its threads."""
    with _lock:
        _users[domain_id] -= 1
        if not _users[domain_id] and domain_id in _handles:
            blocking.dds_delete(_handles.pop(domain_id))
