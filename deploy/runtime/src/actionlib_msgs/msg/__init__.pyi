"""Messages of actionlib_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final

import builtin_interfaces.msg
import std_msgs.msg
from rosidl_runtime_embedded import Message

class GoalID(Message):
    stamp: builtin_interfaces.msg.Time
    id: str
    def __init__(
        self,
        *,
        stamp: builtin_interfaces.msg.Time = ...,
        id: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GoalStatus(Message):
    goal_id: GoalID
    status: int
    text: str
    PENDING: Final = 0
    ACTIVE: Final = 1
    PREEMPTED: Final = 2
    SUCCEEDED: Final = 3
    ABORTED: Final = 4
    REJECTED: Final = 5
    PREEMPTING: Final = 6
    RECALLING: Final = 7
    RECALLED: Final = 8
    LOST: Final = 9
    def __init__(
        self,
        *,
        goal_id: GoalID = ...,
        status: int = ...,
        text: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GoalStatusArray(Message):
    header: std_msgs.msg.Header
    status_list: list[GoalStatus]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        status_list: list[GoalStatus] = ...,
        check_fields: bool = ...,
    ) -> None: ...
