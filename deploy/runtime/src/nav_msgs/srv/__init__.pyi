"""Services of nav_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final, TypeAlias

import geometry_msgs.msg
import nav_msgs.msg
import service_msgs.msg
from rosidl_runtime_embedded import Message, Service

class GetMap_Request(Message):
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...

class GetMap_Response(Message):
    map: nav_msgs.msg.OccupancyGrid
    def __init__(
        self,
        *,
        map: nav_msgs.msg.OccupancyGrid = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetMap_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetMap_Request]
    response: list[GetMap_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetMap_Request] = ...,
        response: list[GetMap_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetMap(Service):
    Request: TypeAlias = GetMap_Request
    Response: TypeAlias = GetMap_Response
    Event: TypeAlias = GetMap_Event

class GetPlan_Request(Message):
    start: geometry_msgs.msg.PoseStamped
    goal: geometry_msgs.msg.PoseStamped
    tolerance: float
    def __init__(
        self,
        *,
        start: geometry_msgs.msg.PoseStamped = ...,
        goal: geometry_msgs.msg.PoseStamped = ...,
        tolerance: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetPlan_Response(Message):
    plan: nav_msgs.msg.Path
    def __init__(
        self,
        *,
        plan: nav_msgs.msg.Path = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetPlan_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[GetPlan_Request]
    response: list[GetPlan_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[GetPlan_Request] = ...,
        response: list[GetPlan_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class GetPlan(Service):
    Request: TypeAlias = GetPlan_Request
    Response: TypeAlias = GetPlan_Response
    Event: TypeAlias = GetPlan_Event

class LoadMap_Request(Message):
    map_url: str
    def __init__(
        self,
        *,
        map_url: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LoadMap_Response(Message):
    map: nav_msgs.msg.OccupancyGrid
    result: int
    RESULT_SUCCESS: Final = 0
    RESULT_MAP_DOES_NOT_EXIST: Final = 1
    RESULT_INVALID_MAP_DATA: Final = 2
    RESULT_INVALID_MAP_METADATA: Final = 3
    RESULT_UNDEFINED_FAILURE: Final = 255
    def __init__(
        self,
        *,
        map: nav_msgs.msg.OccupancyGrid = ...,
        result: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LoadMap_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[LoadMap_Request]
    response: list[LoadMap_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[LoadMap_Request] = ...,
        response: list[LoadMap_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LoadMap(Service):
    Request: TypeAlias = LoadMap_Request
    Response: TypeAlias = LoadMap_Response
    Event: TypeAlias = LoadMap_Event

class SetMap_Request(Message):
    map: nav_msgs.msg.OccupancyGrid
    initial_pose: geometry_msgs.msg.PoseWithCovarianceStamped
    def __init__(
        self,
        *,
        map: nav_msgs.msg.OccupancyGrid = ...,
        initial_pose: geometry_msgs.msg.PoseWithCovarianceStamped = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetMap_Response(Message):
    success: bool
    def __init__(
        self,
        *,
        success: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetMap_Event(Message):
    info: service_msgs.msg.ServiceEventInfo
    request: list[SetMap_Request]
    response: list[SetMap_Response]
    def __init__(
        self,
        *,
        info: service_msgs.msg.ServiceEventInfo = ...,
        request: list[SetMap_Request] = ...,
        response: list[SetMap_Response] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SetMap(Service):
    Request: TypeAlias = SetMap_Request
    Response: TypeAlias = SetMap_Response
    Event: TypeAlias = SetMap_Event
