"""Floods the discovery of a ROS domain on loopback for a bounded time: forged participants or garbage.

    python -m tests.system.discovery_flood DOMAIN KIND SECONDS RATE [PARTICIPANTS]

KIND is `identities` (each packet announces a new participant), `replays` (a few participants again and again)
or `garbage` (random submessages). Each packet goes to the first PARTICIPANTS of the domain, RATE packets a
second in all (RTPS 2.3: 8.5.3 and 9.6.1). It opens raw UDP only, so that it works beside any middleware.
"""

from __future__ import annotations

import random
import socket
import struct
import sys
import time
from collections.abc import Callable

KNOWN = 50  # participants that `replays` announces
MOST = 1_000_000  # packets
_BUILTIN_WRITER = bytes.fromhex("000100c2")  # of SPDP
_HEADER = b"RTPS\x02\x03\x01\x0f"  # version and vendor, before the prefix of a participant


def announcement(number: int) -> bytes:
    """Return the SPDP packet of a participant that does not exist."""
    prefix = struct.pack("<HHQ", 0x0F01, 0xF10D, number)
    locator = struct.pack("<iI12x4s", 1, 9, socket.inet_aton("127.0.0.1"))  # the port that discards all
    parameters = (
        (0x0015, b"\x02\x03\x00\x00"),  # version of the protocol
        (0x0016, b"\x01\x0f\x00\x00"),  # vendor
        (0x0050, prefix + bytes.fromhex("000001c1")),  # identity
        (0x0032, locator),  # for discovery
        (0x0031, locator),  # for messages
        (0x0002, struct.pack("<iI", 20, 0)),  # lease [s]
        (0x0058, struct.pack("<I", 0x0C3F)),  # endpoints of discovery
        (0x0001, b""),  # end
    )
    content = b"\x00\x03\x00\x00" + b"".join(
        struct.pack("<HH", key, len(value)) + value for key, value in parameters
    )
    body = struct.pack("<HH4x4siI", 0, 16, _BUILTIN_WRITER, 0, 1) + content
    return _HEADER + prefix + struct.pack("<BBH", 0x15, 0x05, len(body)) + body


def garbage(number: int) -> bytes:
    """Return a packet with the header of a participant and random submessages."""
    random_ = random.Random(number)
    return _HEADER + random_.randbytes(12) + random_.randbytes(random_.randrange(4, 1400))


KINDS: dict[str, Callable[[int], bytes]] = {
    "identities": announcement,
    "replays": lambda number: announcement(number % KNOWN),
    "garbage": garbage,
}


def flood(domain: int, kind: str, seconds: float, rate: float, participants: int = 20) -> int:
    """Send, and return how many packets were sent."""
    ports = [7410 + 250 * domain + 2 * index for index in range(participants)]
    begin, sent = time.monotonic(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while (passed := time.monotonic() - begin) < seconds and sent < MOST:
            while sent < rate * passed:
                packet = KINDS[kind](sent // participants)
                for port in ports:
                    sender.sendto(packet, ("127.0.0.1", port))
                sent += participants
            time.sleep(0.002)
    return sent


if __name__ == "__main__":
    _, domain, kind, seconds, rate, *more = sys.argv
    print(flood(int(domain), kind, float(seconds), float(rate), *map(int, more)), "packets")
