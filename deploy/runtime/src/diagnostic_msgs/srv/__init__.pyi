"""Services of diagnostic_msgs. Made by rosidl_runtime_embedded.stubs."""

import diagnostic_msgs.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class AddDiagnostics_Request(Message):
    load_namespace: str
    def __init__(
        self,
        *,
        load_namespace: str = ...,
    ) -> None: ...

class AddDiagnostics_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
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
    ) -> None: ...

class AddDiagnostics(Service):
    Request = AddDiagnostics_Request
    Response = AddDiagnostics_Response
    Event = AddDiagnostics_Event

class SelfTest_Request(Message):
    def __init__(self) -> None: ...

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
    ) -> None: ...

class SelfTest(Service):
    Request = SelfTest_Request
    Response = SelfTest_Response
    Event = SelfTest_Event
