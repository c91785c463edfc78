"""Serializes messages as on the network (CDR)."""

from __future__ import annotations

from typing import Any, TypeVar

from rclpy.exceptions import RMWError
from rclpy.type_support import check_is_valid_msg_type

_Message = TypeVar("_Message")


def serialize_message(message: Any) -> bytes:
    """Serialize a message as CDR, with a header of four bytes.

    :raises AttributeError: if it is not a message.
    :raises TypeError, ValueError: if a field has an invalid value.
    """
    message_type: Any = type(message)
    check_is_valid_msg_type(message_type)
    data: bytes = message_type._serialize(message)
    return data


def deserialize_message(serialized_message: bytes, message_type: type[_Message]) -> _Message:
    """Deserialize a message from the bytes of `serialize_message`.

    :raises AttributeError: if `message_type` is not a message or service type.
    :raises RuntimeError: if it is a service type.
    :raises RMWError: if the bytes are not a message of this type.
    :raises TypeError: if `serialized_message` is not bytes-like.
    """
    type_: Any = message_type
    if serialized_message.__class__ is not bytes:  # memory that the caller may change
        serialized_message = bytes(memoryview(serialized_message))
    try:
        message: _Message = type_._deserialize(serialized_message)
    except ValueError as error:
        raise RMWError(f"failed to deserialize ROS message: {error}") from None
    except AttributeError:
        check_is_valid_msg_type(type_)
        raise
    return message
