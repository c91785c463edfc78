"""Services of sensor_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import TypeAlias

import sensor_msgs.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class SetCameraInfo_Request(Message):
    camera_info: sensor_msgs.msg.CameraInfo
    def __init__(
        self,
        *,
        camera_info: sensor_msgs.msg.CameraInfo = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetCameraInfo_Response(Message):
    success: bool
    status_message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        status_message: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetCameraInfo_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SetCameraInfo_Request]
    response: list[SetCameraInfo_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SetCameraInfo_Request] = ...,
        response: list[SetCameraInfo_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetCameraInfo(Service):
    Request: TypeAlias = SetCameraInfo_Request
    Response: TypeAlias = SetCameraInfo_Response
    Event: TypeAlias = SetCameraInfo_Event
