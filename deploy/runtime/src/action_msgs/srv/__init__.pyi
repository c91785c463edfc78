"""Services of action_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final, TypeAlias

import action_msgs.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class CancelGoal_Request(Message):
    goal_info: action_msgs.msg.GoalInfo
    def __init__(
        self,
        *,
        goal_info: action_msgs.msg.GoalInfo = ...,
        check_fields: bool = ...,
    ) -> None: ...

class CancelGoal_Response(Message):
    return_code: int
    goals_canceling: list[action_msgs.msg.GoalInfo]
    ERROR_NONE: Final = 0
    ERROR_REJECTED: Final = 1
    ERROR_UNKNOWN_GOAL_ID: Final = 2
    ERROR_GOAL_TERMINATED: Final = 3
    def __init__(
        self,
        *,
        return_code: int = ...,
        goals_canceling: list[action_msgs.msg.GoalInfo] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class CancelGoal_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[CancelGoal_Request]
    response: list[CancelGoal_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[CancelGoal_Request] = ...,
        response: list[CancelGoal_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class CancelGoal(Service):
    Request: TypeAlias = CancelGoal_Request
    Response: TypeAlias = CancelGoal_Response
    Event: TypeAlias = CancelGoal_Event
