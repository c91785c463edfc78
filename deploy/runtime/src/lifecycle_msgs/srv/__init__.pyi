"""Services of lifecycle_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import TypeAlias

import lifecycle_msgs.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class ChangeState_Request(Message):
    transition: lifecycle_msgs.msg.Transition
    def __init__(
        self,
        *,
        transition: lifecycle_msgs.msg.Transition = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ChangeState_Response(Message):
    success: bool
    def __init__(
        self,
        *,
        success: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ChangeState_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[ChangeState_Request]
    response: list[ChangeState_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[ChangeState_Request] = ...,
        response: list[ChangeState_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ChangeState(Service):
    Request: TypeAlias = ChangeState_Request
    Response: TypeAlias = ChangeState_Response
    Event: TypeAlias = ChangeState_Event

class GetAvailableStates_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class GetAvailableStates_Response(Message):
    available_states: list[lifecycle_msgs.msg.State]
    def __init__(
        self,
        *,
        available_states: list[lifecycle_msgs.msg.State] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetAvailableStates_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetAvailableStates_Request]
    response: list[GetAvailableStates_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetAvailableStates_Request] = ...,
        response: list[GetAvailableStates_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetAvailableStates(Service):
    Request: TypeAlias = GetAvailableStates_Request
    Response: TypeAlias = GetAvailableStates_Response
    Event: TypeAlias = GetAvailableStates_Event

class GetAvailableTransitions_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class GetAvailableTransitions_Response(Message):
    available_transitions: list[lifecycle_msgs.msg.TransitionDescription]
    def __init__(
        self,
        *,
        available_transitions: list[lifecycle_msgs.msg.TransitionDescription] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetAvailableTransitions_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetAvailableTransitions_Request]
    response: list[GetAvailableTransitions_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetAvailableTransitions_Request] = ...,
        response: list[GetAvailableTransitions_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetAvailableTransitions(Service):
    Request: TypeAlias = GetAvailableTransitions_Request
    Response: TypeAlias = GetAvailableTransitions_Response
    Event: TypeAlias = GetAvailableTransitions_Event

class GetState_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class GetState_Response(Message):
    current_state: lifecycle_msgs.msg.State
    def __init__(
        self,
        *,
        current_state: lifecycle_msgs.msg.State = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetState_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetState_Request]
    response: list[GetState_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetState_Request] = ...,
        response: list[GetState_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetState(Service):
    Request: TypeAlias = GetState_Request
    Response: TypeAlias = GetState_Response
    Event: TypeAlias = GetState_Event
