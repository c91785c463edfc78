"""Services of rcl_interfaces. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable
from typing import Final, TypeAlias

import rcl_interfaces.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class DescribeParameters_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class DescribeParameters_Response(Message):
    descriptors: list[rcl_interfaces.msg.ParameterDescriptor]
    def __init__(
        self,
        *,
        descriptors: list[rcl_interfaces.msg.ParameterDescriptor] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class DescribeParameters_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[DescribeParameters_Request]
    response: list[DescribeParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[DescribeParameters_Request] = ...,
        response: list[DescribeParameters_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class DescribeParameters(Service):
    Request: TypeAlias = DescribeParameters_Request
    Response: TypeAlias = DescribeParameters_Response
    Event: TypeAlias = DescribeParameters_Event

class GetLoggerLevels_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetLoggerLevels_Response(Message):
    levels: list[rcl_interfaces.msg.LoggerLevel]
    def __init__(
        self,
        *,
        levels: list[rcl_interfaces.msg.LoggerLevel] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetLoggerLevels_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetLoggerLevels_Request]
    response: list[GetLoggerLevels_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetLoggerLevels_Request] = ...,
        response: list[GetLoggerLevels_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetLoggerLevels(Service):
    Request: TypeAlias = GetLoggerLevels_Request
    Response: TypeAlias = GetLoggerLevels_Response
    Event: TypeAlias = GetLoggerLevels_Event

class GetParameterTypes_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetParameterTypes_Response(Message):
    @property
    def types(self) -> array[int]: ...
    @types.setter
    def types(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        types: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetParameterTypes_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetParameterTypes_Request]
    response: list[GetParameterTypes_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetParameterTypes_Request] = ...,
        response: list[GetParameterTypes_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetParameterTypes(Service):
    Request: TypeAlias = GetParameterTypes_Request
    Response: TypeAlias = GetParameterTypes_Response
    Event: TypeAlias = GetParameterTypes_Event

class GetParameters_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetParameters_Response(Message):
    values: list[rcl_interfaces.msg.ParameterValue]
    def __init__(
        self,
        *,
        values: list[rcl_interfaces.msg.ParameterValue] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetParameters_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetParameters_Request]
    response: list[GetParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetParameters_Request] = ...,
        response: list[GetParameters_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetParameters(Service):
    Request: TypeAlias = GetParameters_Request
    Response: TypeAlias = GetParameters_Response
    Event: TypeAlias = GetParameters_Event

class ListParameters_Request(Message):
    prefixes: list[str]
    depth: int
    DEPTH_RECURSIVE: Final = 0
    def __init__(
        self,
        *,
        prefixes: list[str] = ...,
        depth: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ListParameters_Response(Message):
    result: rcl_interfaces.msg.ListParametersResult
    def __init__(
        self,
        *,
        result: rcl_interfaces.msg.ListParametersResult = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ListParameters_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[ListParameters_Request]
    response: list[ListParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[ListParameters_Request] = ...,
        response: list[ListParameters_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ListParameters(Service):
    Request: TypeAlias = ListParameters_Request
    Response: TypeAlias = ListParameters_Response
    Event: TypeAlias = ListParameters_Event

class SetLoggerLevels_Request(Message):
    levels: list[rcl_interfaces.msg.LoggerLevel]
    def __init__(
        self,
        *,
        levels: list[rcl_interfaces.msg.LoggerLevel] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetLoggerLevels_Response(Message):
    results: list[rcl_interfaces.msg.SetLoggerLevelsResult]
    def __init__(
        self,
        *,
        results: list[rcl_interfaces.msg.SetLoggerLevelsResult] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetLoggerLevels_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SetLoggerLevels_Request]
    response: list[SetLoggerLevels_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SetLoggerLevels_Request] = ...,
        response: list[SetLoggerLevels_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetLoggerLevels(Service):
    Request: TypeAlias = SetLoggerLevels_Request
    Response: TypeAlias = SetLoggerLevels_Response
    Event: TypeAlias = SetLoggerLevels_Event

class SetParameters_Request(Message):
    parameters: list[rcl_interfaces.msg.Parameter]
    def __init__(
        self,
        *,
        parameters: list[rcl_interfaces.msg.Parameter] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetParameters_Response(Message):
    results: list[rcl_interfaces.msg.SetParametersResult]
    def __init__(
        self,
        *,
        results: list[rcl_interfaces.msg.SetParametersResult] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetParameters_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SetParameters_Request]
    response: list[SetParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SetParameters_Request] = ...,
        response: list[SetParameters_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetParameters(Service):
    Request: TypeAlias = SetParameters_Request
    Response: TypeAlias = SetParameters_Response
    Event: TypeAlias = SetParameters_Event

class SetParametersAtomically_Request(Message):
    parameters: list[rcl_interfaces.msg.Parameter]
    def __init__(
        self,
        *,
        parameters: list[rcl_interfaces.msg.Parameter] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetParametersAtomically_Response(Message):
    result: rcl_interfaces.msg.SetParametersResult
    def __init__(
        self,
        *,
        result: rcl_interfaces.msg.SetParametersResult = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetParametersAtomically_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SetParametersAtomically_Request]
    response: list[SetParametersAtomically_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SetParametersAtomically_Request] = ...,
        response: list[SetParametersAtomically_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetParametersAtomically(Service):
    Request: TypeAlias = SetParametersAtomically_Request
    Response: TypeAlias = SetParametersAtomically_Response
    Event: TypeAlias = SetParametersAtomically_Event
