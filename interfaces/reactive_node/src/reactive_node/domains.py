"""A ROS domain of one's own: neither plays nor tests shall meet anybody else on their host."""

from __future__ import annotations

import random
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

DOMAINS = range(30, 102)  # below are those that people choose, above the ports meet those of the system


@contextmanager
def reserved_domain() -> Iterator[int]:
    """
    Keep a ROS_DOMAIN_ID that nobody uses from all others who reserve one on this host, until it is left.

    Raises RuntimeError if there is none.
    """
    with ExitStack() as stack:
        for domain in random.sample(DOMAINS, len(DOMAINS)):
            # An abstract unix socket has one owner, and the kernel takes it back from a killed one.
            owner = stack.enter_context(socket.socket(socket.AF_UNIX))
            try:
                owner.bind(f"\0reactive-arm-domain-{domain}")
            except OSError:
                continue
            if not _has_participants(domain):
                yield domain
                return
    raise RuntimeError(f"no free ROS domain on this host: {DOMAINS[0]} to {DOMAINS[-1]} are all in use")


def _has_participants(domain: int) -> bool:
    """Whether somebody listens on the domain's ports for discovery (RTPS 9.6.1)."""
    for offset in (0, 10):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7400 + 250 * domain + offset))
            except OSError:
                return True
    return False
