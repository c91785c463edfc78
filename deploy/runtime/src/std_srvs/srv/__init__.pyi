"""Services of std_srvs. Made by rosidl_runtime_embedded.stubs."""

from typing import TypeAlias

import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class Empty_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class Empty_Response(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class Empty_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[Empty_Request]
    response: list[Empty_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[Empty_Request] = ...,
        response: list[Empty_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Empty(Service):
    Request: TypeAlias = Empty_Request
    Response: TypeAlias = Empty_Response
    Event: TypeAlias = Empty_Event

class SetBool_Request(Message):
    data: bool
    def __init__(
        self,
        *,
        data: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetBool_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetBool_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SetBool_Request]
    response: list[SetBool_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SetBool_Request] = ...,
        response: list[SetBool_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetBool(Service):
    Request: TypeAlias = SetBool_Request
    Response: TypeAlias = SetBool_Response
    Event: TypeAlias = SetBool_Event

class Trigger_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class Trigger_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Trigger_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[Trigger_Request]
    response: list[Trigger_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[Trigger_Request] = ...,
        response: list[Trigger_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Trigger(Service):
    Request: TypeAlias = Trigger_Request
    Response: TypeAlias = Trigger_Response
    Event: TypeAlias = Trigger_Event
