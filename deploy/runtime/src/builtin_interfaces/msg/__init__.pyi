"""Messages of builtin_interfaces. Made by rosidl_runtime_embedded.stubs."""

from rosidl_runtime_embedded import Message

class Duration(Message):
    sec: int
    nanosec: int
    def __init__(
        self,
        *,
        sec: int = ...,
        nanosec: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Time(Message):
    sec: int
    nanosec: int
    def __init__(
        self,
        *,
        sec: int = ...,
        nanosec: int = ...,
        check_fields: bool = ...,
    ) -> None: ...
