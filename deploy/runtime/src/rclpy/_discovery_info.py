"""``rmw_dds_common/msg/ParticipantEntitiesInfo``: the nodes of a participant, as it announces them to others.

The message class is not used, because its arrays would make every process import NumPy.
"""

from __future__ import annotations

import struct

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

TOPIC = "ros_discovery_info"
TYPE = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"
TYPE_HASH = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"
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


class NodeEntities:
    """A node of any process: its name and the GUIDs of its readers and writers."""

    __slots__ = ("name", "namespace", "readers", "writers")

    def __init__(self, namespace: str, name: str) -> None:
        self.namespace = namespace
        self.name = name
        self.readers: list[bytes] = []
        self.writers: list[bytes] = []


def encode(gid: bytes, nodes: list[NodeEntities]) -> bytes:
    """Encode a participant's GUID and its nodes in CDR."""
    data = bytearray(b"\x00\x01\x00\x00" + gid + struct.pack("<I", len(nodes)))

    def string(text: str) -> None:
        encoded = text.encode() + b"\0"
        data.extend(b"\0" * (-len(data) % 4) + struct.pack("<I", len(encoded)) + encoded)

    for node in nodes:
        string(node.namespace)
        string(node.name)
        for gids in (node.readers, node.writers):
            data.extend(b"\0" * (-len(data) % 4) + struct.pack("<I", len(gids)) + b"".join(gids))
    return bytes(data)


def decode(data: bytes) -> tuple[bytes, list[NodeEntities]]:
    """Decode a participant's GUID and its nodes from CDR. Raises ValueError if it is malformed."""
    position = 20

    def number() -> int:
        nonlocal position
        position += -position % 4
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

    if data[:2] != b"\x00\x01" or len(data) < position:
        raise ValueError("not a ParticipantEntitiesInfo")
    try:
        nodes = []
        for _ in range(number()):
            namespace = octets(number()).rstrip(b"\0").decode()
            node = NodeEntities(namespace, octets(number()).rstrip(b"\0").decode())
            node.readers = [octets(16) for _ in range(number())]
            node.writers = [octets(16) for _ in range(number())]
            nodes.append(node)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(str(error)) from error
    return data[4:20], nodes
