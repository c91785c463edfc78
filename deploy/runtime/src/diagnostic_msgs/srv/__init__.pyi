"""Services of diagnostic_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import TypeAlias

import diagnostic_msgs.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class AddDiagnostics_Request(Message):
    load_namespace: str
    def __init__(
        self,
        *,
        load_namespace: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class AddDiagnostics_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class AddDiagnostics_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[AddDiagnostics_Request]
    response: list[AddDiagnostics_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[AddDiagnostics_Request] = ...,
        response: list[AddDiagnostics_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class AddDiagnostics(Service):
    Request: TypeAlias = AddDiagnostics_Request
    Response: TypeAlias = AddDiagnostics_Response
    Event: TypeAlias = AddDiagnostics_Event

class SelfTest_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class SelfTest_Response(Message):
    id: str
    passed: bytes
    status: list[diagnostic_msgs.msg.DiagnosticStatus]
    def __init__(
        self,
        *,
        id: str = ...,
        passed: bytes = ...,
        status: list[diagnostic_msgs.msg.DiagnosticStatus] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SelfTest_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SelfTest_Request]
    response: list[SelfTest_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SelfTest_Request] = ...,
        response: list[SelfTest_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SelfTest(Service):
    Request: TypeAlias = SelfTest_Request
    Response: TypeAlias = SelfTest_Response
    Event: TypeAlias = SelfTest_Event
