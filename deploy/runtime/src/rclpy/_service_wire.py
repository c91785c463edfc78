"""Requests and replies on the wire, and who belongs to whom (facts/wire_samples.json, discovery.txt).

A service is two DDS topics. Every message starts with 16 octets, echoed in the reply: the requesting writer's
handle and a sequence number. As 16 is a multiple of CDR's largest alignment, the message that follows is laid
out as if it stood alone.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from rclpy._dds import Reader, Writer
from rclpy._dds.qos import user_data_value

_ENCAPSULATION = b"\x00\x01\x00\x00"
_HEADER = struct.Struct("<4sQq")


class RequestId(NamedTuple):
    """Which request of which client; ``publication_handle`` is the writer's as this process knows it."""

    client: int
    sequence_number: int
    publication_handle: int = 0


def wrap(request_id: RequestId, message: bytes) -> bytes:
    """CDR of a request or reply from the CDR of its message."""
    header = _HEADER.pack(_ENCAPSULATION, request_id.client, request_id.sequence_number)
    return header + message[len(_ENCAPSULATION) :]


def unwrap(data: bytes) -> tuple[RequestId, bytes]:
    """Identity and message of a request or reply. Raises ValueError if it is too short for that."""
    if len(data) < _HEADER.size:
        raise ValueError(f"{len(data)} octets are too few for a request header of {_HEADER.size}")
    encapsulation, client, sequence_number = _HEADER.unpack_from(data)
    return RequestId(client, sequence_number), encapsulation + data[_HEADER.size :]


def server_is_matched(requests: Writer, replies: Reader) -> bool:
    """Whether a server reads our requests and writes our replies, both ends of the same one."""
    readers = {user_data_value(data, "serviceid") for data in requests.matched_user_data()}
    writers = {user_data_value(data, "serviceid") for data in replies.matched_user_data()}
    return bool(readers & writers)


def client_is_matched(requests: Reader, replies: Writer, publication_handle: int) -> bool | None:
    """Whether the client behind a request reads our replies already; ``None`` if it has gone."""
    data = requests.user_data_of(publication_handle)
    if data is None:
        return None
    client = user_data_value(data, "clientid")
    # A client that does not name itself cannot be waited for.
    return not client or any(
        user_data_value(reader, "clientid") == client for reader in replies.matched_user_data()
    )
