"""Messages of action_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final

import builtin_interfaces.msg
import unique_identifier_msgs.msg
from rosidl_runtime_embedded import Message

class GoalInfo(Message):
    goal_id: unique_identifier_msgs.msg.UUID
    stamp: builtin_interfaces.msg.Time
    def __init__(
        self,
        *,
        goal_id: unique_identifier_msgs.msg.UUID = ...,
        stamp: builtin_interfaces.msg.Time = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GoalStatus(Message):
    goal_info: GoalInfo
    status: int
    STATUS_UNKNOWN: Final = 0
    STATUS_ACCEPTED: Final = 1
    STATUS_EXECUTING: Final = 2
    STATUS_CANCELING: Final = 3
    STATUS_SUCCEEDED: Final = 4
    STATUS_CANCELED: Final = 5
    STATUS_ABORTED: Final = 6
    def __init__(
        self,
        *,
        goal_info: GoalInfo = ...,
        status: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GoalStatusArray(Message):
    status_list: list[GoalStatus]
    def __init__(
        self,
        *,
        status_list: list[GoalStatus] = ...,
        check_fields: bool = ...,
    ) -> None: ...
