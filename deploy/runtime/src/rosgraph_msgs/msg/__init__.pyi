"""Messages of rosgraph_msgs. Made by rosidl_runtime_embedded.stubs."""

import builtin_interfaces.msg
from rosidl_runtime_embedded import Message

class Clock(Message):
    clock: builtin_interfaces.msg.Time
    def __init__(
        self,
        *,
        clock: builtin_interfaces.msg.Time = ...,
        check_fields: bool = ...,
    ) -> None: ...
