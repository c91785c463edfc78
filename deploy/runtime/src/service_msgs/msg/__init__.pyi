"""Messages of service_msgs. Made by rosidl_runtime_embedded.stubs."""

from collections.abc import Iterable
from typing import Final

import numpy
from numpy.typing import NDArray

import builtin_interfaces.msg
from rosidl_runtime_embedded import Message

class ServiceEventInfo(Message):
    event_type: int
    stamp: builtin_interfaces.msg.Time
    @property
    def client_gid(self) -> NDArray[numpy.uint8]: ...
    @client_gid.setter
    def client_gid(self, value: Iterable[int]) -> None: ...
    sequence_number: int
    REQUEST_SENT: Final = 0
    REQUEST_RECEIVED: Final = 1
    RESPONSE_SENT: Final = 2
    RESPONSE_RECEIVED: Final = 3
    def __init__(
        self,
        *,
        event_type: int = ...,
        stamp: builtin_interfaces.msg.Time = ...,
        client_gid: Iterable[int] = ...,
        sequence_number: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
