"""Services of composition_interfaces. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable
from typing import TypeAlias

import rcl_interfaces.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class ListNodes_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class ListNodes_Response(Message):
    full_node_names: list[str]
    @property
    def unique_ids(self) -> array[int]: ...
    @unique_ids.setter
    def unique_ids(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        full_node_names: list[str] = ...,
        unique_ids: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ListNodes_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[ListNodes_Request]
    response: list[ListNodes_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[ListNodes_Request] = ...,
        response: list[ListNodes_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ListNodes(Service):
    Request: TypeAlias = ListNodes_Request
    Response: TypeAlias = ListNodes_Response
    Event: TypeAlias = ListNodes_Event

class LoadNode_Request(Message):
    package_name: str
    plugin_name: str
    node_name: str
    node_namespace: str
    log_level: int
    remap_rules: list[str]
    parameters: list[rcl_interfaces.msg.Parameter]
    extra_arguments: list[rcl_interfaces.msg.Parameter]
    def __init__(
        self,
        *,
        package_name: str = ...,
        plugin_name: str = ...,
        node_name: str = ...,
        node_namespace: str = ...,
        log_level: int = ...,
        remap_rules: list[str] = ...,
        parameters: list[rcl_interfaces.msg.Parameter] = ...,
        extra_arguments: list[rcl_interfaces.msg.Parameter] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LoadNode_Response(Message):
    success: bool
    error_message: str
    full_node_name: str
    unique_id: int
    def __init__(
        self,
        *,
        success: bool = ...,
        error_message: str = ...,
        full_node_name: str = ...,
        unique_id: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LoadNode_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[LoadNode_Request]
    response: list[LoadNode_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[LoadNode_Request] = ...,
        response: list[LoadNode_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LoadNode(Service):
    Request: TypeAlias = LoadNode_Request
    Response: TypeAlias = LoadNode_Response
    Event: TypeAlias = LoadNode_Event

class UnloadNode_Request(Message):
    unique_id: int
    def __init__(
        self,
        *,
        unique_id: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class UnloadNode_Response(Message):
    success: bool
    error_message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        error_message: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class UnloadNode_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[UnloadNode_Request]
    response: list[UnloadNode_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[UnloadNode_Request] = ...,
        response: list[UnloadNode_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class UnloadNode(Service):
    Request: TypeAlias = UnloadNode_Request
    Response: TypeAlias = UnloadNode_Response
    Event: TypeAlias = UnloadNode_Event
