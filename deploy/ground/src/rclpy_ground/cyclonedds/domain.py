"""Joins DDS domains, with Cyclone DDS configured from the environment variables of ROS 2.

Sources: ROS 2 Jazzy, "Improved dynamic discovery", for ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_STATIC_PEERS,
ROS_LOCALHOST_ONLY (deprecated, still obeyed) and ROS_DOMAIN_ID; rmw_cyclonedds_cpp 2.2.2 for the settings of
Cyclone that implement them. The settings of Cyclone's CYCLONEDDS_URI win.
"""

from __future__ import annotations

import ctypes as ct
import os
import re
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from rclpy_ground.genuine import RCLError

from . import security
from .library import IS_RECENT, PRECONDITION_NOT_MET, NetworkAddress, blocking, checked, libc

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_CHOICE = re.compile(r"<(networkinterface|transport|useipv6)\b", re.IGNORECASE)  # Cyclone ignores case, too
_NO_MULTICAST = "<AllowMulticast>false</AllowMulticast>"
# Packets to localhost arrive on the loopback interface. Otherwise, Cyclone drops them if it does not use it.
_FROM_ANY_INTERFACE = (
    "<Internal><ExtendedPacketInfo>false</ExtendedPacketInfo></Internal>" if IS_RECENT else ""
)
# On loopback, the fewer datagrams a large message needs, the less time it takes. If they overflow
# the receiving socket, whose size the kernel limits (net.core.rmem_max), one request covers 256 fragments.
_LARGE_DATAGRAMS = "<MaxMessageSize>65000 B</MaxMessageSize><FragmentSize>64000 B</FragmentSize>"
_LARGE_BURSTS = '<SocketReceiveBufferSize max="16 MiB"/><NackDelay>10 ms</NackDelay>'
# A writer sends what the socket holds [%], and the reader asks for the rest. Otherwise the end of a larger
# message is lost, which the reader notices with the next heartbeat, 100 ms later. With a small socket, asking
# takes longer.
_AS_MUCH_AS_FITS = "<BurstSize><MaxInitTransmit>90</MaxInitTransmit></BurstSize>"
_LARGE_SOCKET = 1_000_000  # octets
_LARGEST_SOCKET = Path("/proc/sys/net/core/rmem_max")
_LOOPBACK_IS_DOWN = (
    "the loopback interface is down, but nodes of one host meet through it: run `ip link set lo up`"
)
# For so long, a writer that is deleted waits for readers that have not acknowledged its last messages.
# Cyclone's second for each writer delays a restart while a reader is dead, but not missed yet.
_SOON_DELETED = "<Internal><WriterLingerDuration>100 ms</WriterLingerDuration></Internal>"
# Version 0.10 neither knows nor needs these: it asks peers without end, and obeys AllowMulticast alone.
_FOREVER = ' PruneDelay="inf"' if IS_RECENT else ""
_NEVER_MULTICAST = ' allow_multicast="false"' if IS_RECENT else ""
_LAST_DOMAIN = 232  # the next one has no ports: DDSI-RTPS 2.5, 9.6.2.3
_AF_INET = 2
_IFF_UP, _IFF_LOOPBACK = 0x1, 0x8

_lock = threading.Lock()
_users: dict[int, int] = {}  # domain id -> number of participants of this process
_handles: dict[int, int] = {}


def configuration(environment: Mapping[str, str] | None = None, domain_id: int = 0) -> str:
    """Return Cyclone's configuration of a domain. Raises RCLError if it or the environment is invalid."""
    if domain_id > _LAST_DOMAIN:
        raise RCLError(f"a DDS domain has a number from 0 to {_LAST_DOMAIN}, not {domain_id}")
    environment = os.environ if environment is None else environment
    security.check(environment)
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
    if discovery_range == "SYSTEM_DEFAULT":
        return uri
    if discovery_range == "OFF":
        own = _off()
    else:
        peers = [peer for peer in peers if _has_address(peer, only_ipv4=not uri)]
        settings = _localhost if discovery_range == "LOCALHOST" else _subnet
        general, discovery = settings(peers, _choices(uri))
        own = f"{general}<Discovery>{_index(domain_id)}{discovery}</Discovery>"
    return f"<CycloneDDS><Domain>{own}{_SOON_DELETED}</Domain></CycloneDDS>" + (f",{uri}" if uri else "")


def _off() -> str:
    """Return the settings for OFF: no other process discovers this one."""
    tag = f"<Tag>ros_discovery_off_{os.getpid()}</Tag>"
    index = "<ParticipantIndex>none</ParticipantIndex>"
    return f"<General>{_NO_MULTICAST}</General><Discovery>{index}{tag}</Discovery>"


def _localhost(peers: list[str], choices: set[str]) -> tuple[str, str]:
    """Return the settings for LOCALHOST: all nodes of the host meet, and nothing leaves it except to peers.

    Without multicast, a process must ask every participant index on localhost. It never stops: nodes of ROS 2
    in SUBNET do not ask localhost when they start.

    If Cyclone prefers the loopback interface, it does not reach peers on other hosts. So with peers, the
    interface is Cyclone's choice, as in ROS 2.
    """
    interfaces = "" if peers or choices else _loopback_and_default()
    datagrams, internal = (_LARGE_DATAGRAMS, _large_bursts()) if interfaces else ("", _FROM_ANY_INTERFACE)
    general = f"<General>{_NO_MULTICAST}{interfaces}{datagrams}</General>{internal}"
    # By default, Cyclone 11 asks every 30 s, and only for 30 s.
    return general, "<SPDPInterval>8s</SPDPInterval>" + _peers(peers, choices, _FOREVER)


def _large_bursts() -> str:
    """Return the settings for messages that are larger than the receiving socket."""
    with suppress(OSError, ValueError):
        if int(_LARGEST_SOCKET.read_text()) >= _LARGE_SOCKET:
            return f"<Internal>{_LARGE_BURSTS}{_AS_MUCH_AS_FITS}</Internal>"
    return f"<Internal>{_LARGE_BURSTS}</Internal>"


def _subnet(peers: list[str], choices: set[str]) -> tuple[str, str]:
    """Return the settings for SUBNET: multicast, and a question to nodes of the host that do not hear it."""
    return _FROM_ANY_INTERFACE, _peers(peers, choices)


def _peers(peers: list[str], choices: set[str], how_long: str = "") -> str:
    addresses = "".join(f'<Peer address="{peer}"/>' for peer in peers)
    # With IPv6, 127.0.0.1 would be an error. Where Cyclone cannot use multicast, it adds its own address.
    if not choices & {"transport", "useipv6"}:
        addresses = f'<Peer address="127.0.0.1"{how_long}/>{addresses}'
    return f"<Peers>{addresses}</Peers>"


def _index(domain_id: int) -> str:
    """Return the settings for 100 processes on a host. Jazzy's limit of 32 is too low for a fleet.

    Cyclone does not use the last index. In domain 232, fewer processes have ports.
    """
    last = min(100, (65535 - 7411 - 250 * domain_id) // 2)  # DDSI-RTPS 2.5, 9.6.2.3: the ports of an index
    return (
        f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{last}</MaxAutoParticipantIndex>"
    )


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


def _choices(uri: str) -> set[str]:
    """Return which elements of CYCLONEDDS_URI, inline or in files, choose network interfaces or a transport.

    If any does, this ground must not name interfaces: Cyclone fails if an interface is named twice, or has
    no address for the transport.
    """
    settings = [uri]
    for source in uri.split(","):
        with suppress(OSError):  # Cyclone reports unreadable files
            settings.append(Path(source.strip().removeprefix("file://")).read_text(errors="replace"))
    return {name.lower() for text in settings for name in _CHOICE.findall(_COMMENT.sub("", text))}


def _loopback_and_default() -> str:
    """Return the settings for the loopback interface and, if there is another one, for Cyclone's choice.

    Cyclone prefers the loopback interface if both sides use it. So processes of this ground do not notice
    when the other interface loses its address. Other nodes of the host may use only the other interface.
    """
    interfaces = ipv4_interfaces()
    loopback = next((name for name, flags in interfaces if flags & _IFF_LOOPBACK), None)
    if loopback is None:  # Cyclone would use another interface and find no node
        raise RCLError(_LOOPBACK_IS_DOWN)
    chosen = [f'name="{loopback}"']
    if any(not flags & _IFF_LOOPBACK for _, flags in interfaces):
        chosen.append('autodetermine="true"')
    # Multicast in CYCLONEDDS_URI must not leave the host by mistake: it must name the interfaces, too.
    elements = "".join(f"<NetworkInterface {choice}{_NEVER_MULTICAST}/>" for choice in chosen)
    return f"<Interfaces>{elements}</Interfaces>"


def ipv4_interfaces() -> list[tuple[str, int]]:
    """Return the name and flags of each interface that is up, once for each of its IPv4 addresses."""
    found = []
    first = ct.POINTER(NetworkAddress)()
    if libc.getifaddrs(ct.byref(first)):
        return []
    entry = first
    while entry:
        address = entry.contents
        if address.family and address.family[0] == _AF_INET and address.flags & _IFF_UP:
            found.append((address.name.decode(errors="replace"), address.flags))
        entry = address.next
    libc.freeifaddrs(first)
    return found


def enter(domain_id: int) -> None:
    """Configure a domain before the first participant of this process. Raises RCLError if that fails."""
    with _lock:
        if not _users.get(domain_id):
            handle = blocking.dds_create_domain(domain_id, configuration(domain_id=domain_id).encode())
            # If other code in this process has created the domain, its configuration applies.
            if handle != PRECONDITION_NOT_MET:
                if handle < 0 and not ipv4_interfaces():
                    raise RCLError(_LOOPBACK_IS_DOWN)
                _handles[domain_id] = checked(handle, f"cannot configure DDS domain {domain_id}")
        _users[domain_id] = _users.get(domain_id, 0) + 1


def leave(domain_id: int) -> None:
    """Undo one ``enter``; the last call deletes the domain and ends its threads."""
    with _lock:
        _users[domain_id] -= 1
        if not _users[domain_id] and domain_id in _handles:
            blocking.dds_delete(_handles.pop(domain_id))
