"""The network interface lo, through which the processes of one host meet."""

from __future__ import annotations

import fcntl
import socket
import struct
from contextlib import suppress

from interfaces.seam import replaceable

LOOPBACK_DOWN = "the network interface lo is down, and services do not hear each other: ip link set lo up"

_SIOCGIFFLAGS, _IFF_UP = 0x8913, 1  # netdevice(7)


@replaceable
def loopback_is_up() -> bool:
    """Whether there is a network interface lo, and it is up."""
    request = struct.pack("16sH22x", b"lo", 0)
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        answer = fcntl.ioctl(any_socket, _SIOCGIFFLAGS, request)
        return bool(struct.unpack("16xH22x", answer)[0] & _IFF_UP)
    return False
