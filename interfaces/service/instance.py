"""One live instance of a service per host, user, ROS domain and node name."""

from __future__ import annotations

import hashlib
import os
import socket
from collections.abc import Mapping
from itertools import count

from rclpy.node import Node

from interfaces.service.unix_sockets import bind, owners


class AlreadyRunning(Exception):
    """A live instance of this service runs on this host and domain."""


def claim(node: Node, *, others_count: bool = False) -> socket.socket:
    """Claim the name of a node on this host and domain, for as long as the returned socket lives.

    The claim is an abstract unix socket: the kernel frees it when the process ends, however it ends. Another
    user may bind its address first, but the kernel shows which user. So a name has many addresses: the claim
    is the first free one, and counts if this user has no other. A later process sees the earlier claim.

    :param others_count: whether a claim of another user counts.
    :raises AlreadyRunning: if a live process holds the claim.
    """
    name = node.get_fully_qualified_name()
    domain = node.context.get_domain_id()
    refusal = AlreadyRunning(f"{name} already runs in domain {domain}")
    held = _bind(_address(name, domain), refusal)
    users = [*owners(_address(name, domain)).values()]
    if users.count(os.geteuid()) > 1 or (others_count and {*users} != {os.geteuid()}):
        held.close()
        raise refusal
    return held


def holders(name: str, domain: int) -> set[int]:
    """Return the users whose live processes of this host hold the claim on a fully qualified node name."""
    return {*owners(_address(name, domain)).values()}


def _bind(address: str, refusal: AlreadyRunning) -> socket.socket:
    """Bind the first address that no other user has; raise the refusal if we have one already."""
    taken: Mapping[str, int] = {}
    while True:
        free = next(each for each in map(f"{address}{{}}".format, count()) if each not in taken)
        try:
            return bind(free)
        except OSError:
            taken = owners(address)
            if os.geteuid() in taken.values():
                raise refusal from None


def _address(name: str, domain: int) -> str:
    digest = hashlib.sha256(name.encode()).hexdigest()[:32]  # an address has at most 107 bytes
    return f"reactive-arm/{domain}/{digest}/"
