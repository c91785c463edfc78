"""Messages as bytes, in the form they have on the network (CDR)."""

from __future__ import annotations

from typing import Any, TypeVar

from rclpy.exceptions import NoTypeSupportImportedException

_Message = TypeVar("_Message")


def serialize_message(message: Any) -> bytes:
    """
    Return a message as CDR with its four bytes of header.

    :raises NoTypeSupportImportedException: if it is no message.
    :raises TypeError, ValueError: if a field has a value that it cannot have.
    """
    serialize = getattr(type(message), "_serialize", None)
    if serialize is None:
        raise NoTypeSupportImportedException
    data: bytes = serialize(message)
    return data


def deserialize_message(serialized_message: bytes, message_type: type[_Message]) -> _Message:
    """
    Return the message that `serialize_message` turned into these bytes.

    :raises NoTypeSupportImportedException: if `message_type` is no message type.
    :raises ValueError: if the bytes are no message of that type.
    """
    deserialize = getattr(message_type, "_deserialize", None)
    if deserialize is None:
        raise NoTypeSupportImportedException
    message: _Message = deserialize(serialized_message)
    return message
