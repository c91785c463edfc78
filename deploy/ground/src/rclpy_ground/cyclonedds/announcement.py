"""``rmw_dds_common/msg/ParticipantEntitiesInfo``: the nodes of a participant, as it announces them to others.

DDS discovers endpoints; this message says which nodes they belong to.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rclpy_ground.interface import NodeName

TOPIC = "ros_discovery_info"
TYPE = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"
USER_DATA = "typehash=RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e;"
WRITER_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
READER_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    depth=0,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
GID_AT = slice(4, 20)
"""Where the GUID of the participant is in a message."""


class Entities(NamedTuple):
    """The GUIDs of a node's endpoints."""

    readers: list[bytes]
    writers: list[bytes]


def encode(gid: bytes, nodes: dict[NodeName, Entities]) -> bytes:
    """Encode a participant's GUID and its nodes in CDR."""
    data = bytearray(b"\x00\x01\x00\x00" + gid + struct.pack("<I", len(nodes)))

    def string(text: str) -> None:
        encoded = text.encode() + b"\0"
        data.extend(b"\0" * (-len(data) % 4) + struct.pack("<I", len(encoded)) + encoded)

    for name, entities in nodes.items():
        string(name.namespace)
        string(name.name)
        for gids in entities:
            data.extend(b"\0" * (-len(data) % 4) + struct.pack("<I", len(gids)) + b"".join(gids))
    return bytes(data)


def decode(data: bytes) -> list[tuple[NodeName, Entities]]:
    """Decode the nodes of a participant from CDR. Raises ValueError if it is malformed.

    A name that is not UTF-8 is a name with replaced characters: it is of a stranger.
    """
    position = GID_AT.stop

    def number() -> int:
        nonlocal position
        position += -position % 4
        if len(data) < position + 4:
            raise ValueError("a length beyond the end")
        (value,) = struct.unpack_from("<I", data, position)
        position += 4
        if value > len(data) - position:
            raise ValueError("a length beyond the end")
        return int(value)

    def octets(count: int) -> bytes:
        nonlocal position
        if count > len(data) - position:
            raise ValueError("a length beyond the end")
        position += count
        return data[position - count : position]

    def text() -> str:
        return octets(number()).rstrip(b"\0").decode(errors="replace")

    def gids() -> list[bytes]:
        return [octets(16) for _ in range(number())]

    if data[:2] != b"\x00\x01":
        raise ValueError("not a ParticipantEntitiesInfo")
    return [(NodeName(text(), text(), str(index)), Entities(gids(), gids())) for index in range(number())]
