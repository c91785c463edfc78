"""Services of visualization_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import TypeAlias

import service_msgs.msg
import visualization_msgs.msg
from rosidl_runtime_embedded import Message, Service

class GetInteractiveMarkers_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class GetInteractiveMarkers_Response(Message):
    sequence_number: int
    markers: list[visualization_msgs.msg.InteractiveMarker]
    def __init__(
        self,
        *,
        sequence_number: int = ...,
        markers: list[visualization_msgs.msg.InteractiveMarker] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetInteractiveMarkers_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetInteractiveMarkers_Request]
    response: list[GetInteractiveMarkers_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetInteractiveMarkers_Request] = ...,
        response: list[GetInteractiveMarkers_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetInteractiveMarkers(Service):
    Request: TypeAlias = GetInteractiveMarkers_Request
    Response: TypeAlias = GetInteractiveMarkers_Response
    Event: TypeAlias = GetInteractiveMarkers_Event
