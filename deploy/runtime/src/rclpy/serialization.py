"""Messages as bytes, in the form they have on the network (CDR)."""

from __future__ import annotations

from typing import Any, TypeVar

from rclpy.exceptions import RMWError
from rclpy.type_support import check_is_valid_msg_type

_Message = TypeVar("_Message")


def serialize_message(message: Any) -> bytes:
    """
    Return a message as CDR with its four bytes of header.

    :raises AttributeError: if it is no message.
    :raises TypeError, ValueError: if a field has a value that it cannot have.
    """
    message_type: Any = type(message)
    check_is_valid_msg_type(message_type)
    data: bytes = message_type._serialize(message)
    return data


def deserialize_message(serialized_message: bytes, message_type: type[_Message]) -> _Message:
    """
    Return the message that `serialize_message` turned into these bytes.

    :raises AttributeError: if `message_type` is no type of messages or services.
    :raises RuntimeError: if it is a type of services.
    :raises RMWError: if the bytes are no message of that type.
    """
    type_: Any = message_type
    check_is_valid_msg_type(type_)
    try:
        message: _Message = type_._deserialize(serialized_message)
    except ValueError as error:
        raise RMWError(f"failed to deserialize ROS message: {error}") from None
    return message
