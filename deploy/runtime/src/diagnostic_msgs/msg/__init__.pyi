"""Messages of diagnostic_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final

import std_msgs.msg
from rosidl_runtime_embedded import Message

class DiagnosticArray(Message):
    header: std_msgs.msg.Header
    status: list[DiagnosticStatus]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        status: list[DiagnosticStatus] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class DiagnosticStatus(Message):
    level: bytes
    name: str
    message: str
    hardware_id: str
    values: list[KeyValue]
    OK: Final = b"\x00"
    WARN: Final = b"\x01"
    ERROR: Final = b"\x02"
    STALE: Final = b"\x03"
    def __init__(
        self,
        *,
        level: bytes = ...,
        name: str = ...,
        message: str = ...,
        hardware_id: str = ...,
        values: list[KeyValue] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class KeyValue(Message):
    key: str
    value: str
    def __init__(
        self,
        *,
        key: str = ...,
        value: str = ...,
        check_fields: bool = ...,
    ) -> None: ...
