"""Free ROS domains, for tests and simulations that must not meet other nodes on their host."""

from __future__ import annotations

import random
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

DOMAINS = range(30, 102)  # users choose lower ones; the ports of higher ones meet ephemeral ports


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Reserve a ROS domain without participants on this host. Raises RuntimeError if none is free."""
    with ExitStack() as stack:
        for domain in random.sample(DOMAINS, len(DOMAINS)):
            # An abstract unix socket has one owner, and the kernel frees it when the owner dies.
            owner = stack.enter_context(socket.socket(socket.AF_UNIX))
            try:
                owner.bind(f"\0reactive-node-domain-{domain}")
            except OSError:
                continue
            if not has_participants(domain):
                yield domain
                return
    raise RuntimeError(f"no free ROS domain on this host: {DOMAINS[0]} to {DOMAINS[-1]} are all in use")


def has_participants(domain: int) -> bool:
    """Whether a socket has one of the 250 ports of the domain (RTPS 9.6.1).

    The first ports do not show it: participants keep theirs after those with lower indices have ended.
    """
    for port in range(7400 + 250 * domain, 7400 + 250 * (domain + 1)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                return True
    return False
