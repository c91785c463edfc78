"""Requests and replies on the wire, and the matching of clients and servers.

A service is two DDS topics. Every message starts with a header of 16 octets, which the reply repeats: the
requesting writer's handle and a sequence number. 16 is a multiple of CDR's largest alignment, so the header
does not change the layout of the message behind it. Source: facts/wire_samples.json, facts/discovery.txt.

That is the form of ROS 2's middleware for Cyclone DDS. Those of other DDS have no header, but a field of RTPS
that Cyclone DDS cannot set. They take the header for the message, and may allocate all memory for an array
that they find there (ros2/rmw_cyclonedds#184, #577). Endpoints of our form have an identifier in USER_DATA.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from rclpy._dds import Reader, Writer
from rclpy._dds.qos import user_data_value

_ENCAPSULATION = b"\x00\x01\x00\x00"
_HEADER = struct.Struct("<4sQq")


class RequestId(NamedTuple):
    """Identifies a request of a client; ``publication_handle`` is a local handle of the client's writer."""

    client: int
    sequence_number: int
    publication_handle: int = 0


def wrap(request_id: RequestId, message: bytes) -> bytes:
    """Return the CDR of a request or reply, given the CDR of its message."""
    header = _HEADER.pack(_ENCAPSULATION, request_id.client, request_id.sequence_number)
    return header + message[len(_ENCAPSULATION) :]


def unwrap(data: bytes) -> tuple[RequestId, bytes]:
    """Return identity and message of a request or reply. Raises ValueError if it is too short."""
    if len(data) < _HEADER.size:
        raise ValueError(f"{len(data)} octets are too few for a request header of {_HEADER.size}")
    encapsulation, client, sequence_number = _HEADER.unpack_from(data)
    return RequestId(client, sequence_number), encapsulation + data[_HEADER.size :]


def server_is_matched(requests: Writer, replies: Reader) -> bool:
    """Whether a single server both reads our requests and writes our replies, and no reader needs others."""
    readers = {user_data_value(data, "serviceid") for data in requests.matched_user_data()}
    writers = {user_data_value(data, "serviceid") for data in replies.matched_user_data()}
    return "" not in readers and bool(readers & writers)


def has_other_servers(requests: Writer) -> bool:
    """Whether a server of another form of requests, without our header, would read a request."""
    return any(not user_data_value(data, "serviceid") for data in requests.matched_user_data())


def check_client(requests: Reader, publication_handle: int) -> None:
    """Raise ValueError if the client of a request is not one of ours."""
    data = requests.user_data_of(publication_handle)
    if data is not None and not user_data_value(data, "clientid"):
        raise ValueError("its client is on another DDS, whose requests have no header of Cyclone DDS")


def client_is_matched(requests: Reader, replies: Writer, publication_handle: int) -> bool | None:
    """Whether the client of a request already reads our replies; ``None`` if it is gone."""
    data = requests.user_data_of(publication_handle)
    if data is None:
        return None
    client = user_data_value(data, "clientid")
    return any(user_data_value(reader, "clientid") == client for reader in replies.matched_user_data())
