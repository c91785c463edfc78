"""Coordinate frames over time: a buffer of transforms between them, with the API of ROS 2's tf2_py."""

from tf2_py._buffer_core import BufferCore
from tf2_py._exceptions import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)

__all__ = [
    "BufferCore",
    "TransformException",
    "ConnectivityException",
    "LookupException",
    "ExtrapolationException",
    "InvalidArgumentException",
    "TimeoutException",
]
