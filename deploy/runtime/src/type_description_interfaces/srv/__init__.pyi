"""Services of type_description_interfaces. Made by rosidl_runtime_embedded.stubs."""

from typing import Final, TypeAlias

import service_msgs.msg
import type_description_interfaces.msg
from rosidl_runtime_embedded import Message, Service

class GetTypeDescription_Request(Message):
    type_name: str
    type_hash: str
    include_type_sources: bool
    INCLUDE_TYPE_SOURCES__DEFAULT: Final = True
    def __init__(
        self,
        *,
        type_name: str = ...,
        type_hash: str = ...,
        include_type_sources: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetTypeDescription_Response(Message):
    successful: bool
    failure_reason: str
    type_description: type_description_interfaces.msg.TypeDescription
    type_sources: list[type_description_interfaces.msg.TypeSource]
    extra_information: list[type_description_interfaces.msg.KeyValue]
    def __init__(
        self,
        *,
        successful: bool = ...,
        failure_reason: str = ...,
        type_description: type_description_interfaces.msg.TypeDescription = ...,
        type_sources: list[type_description_interfaces.msg.TypeSource] = ...,
        extra_information: list[type_description_interfaces.msg.KeyValue] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetTypeDescription_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetTypeDescription_Request]
    response: list[GetTypeDescription_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetTypeDescription_Request] = ...,
        response: list[GetTypeDescription_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetTypeDescription(Service):
    Request: TypeAlias = GetTypeDescription_Request
    Response: TypeAlias = GetTypeDescription_Response
    Event: TypeAlias = GetTypeDescription_Event
