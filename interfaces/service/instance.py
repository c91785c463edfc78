"""One live instance of a service per host, ROS domain and node name."""

from __future__ import annotations

import hashlib
import socket
from pathlib import Path

from rclpy.node import Node


class AlreadyRunning(Exception):
    """A live instance of this service runs on this host and domain."""


def claim(node: Node) -> socket.socket:
    """Claim the name of a node on this host and domain, for as long as the returned socket lives.

    The claim is an abstract unix socket: the kernel frees it when the process ends, however it ends.

    :raises AlreadyRunning: if a live process holds the claim.
    """
    name = node.get_fully_qualified_name()
    domain = node.context.get_domain_id()
    held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        held.bind(f"\0{_address(name, domain)}")
    except OSError:
        held.close()
        raise AlreadyRunning(f"{name} already runs in domain {domain}") from None
    return held


def is_claimed(name: str, domain: int) -> bool:
    """Return whether a live process of this host holds the claim on a fully qualified node name."""
    # As bytes: sockets of other programs may have any name.
    return f"@{_address(name, domain)}\n".encode() in Path("/proc/net/unix").read_bytes()


def _address(name: str, domain: int) -> str:
    digest = hashlib.sha256(name.encode()).hexdigest()[:32]  # an address has at most 107 bytes
    return f"reactive-arm/{domain}/{digest}"
