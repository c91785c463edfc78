"""Messages of nav_msgs. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable

import builtin_interfaces.msg
import geometry_msgs.msg
import std_msgs.msg
from rosidl_runtime_embedded import Message

class GridCells(Message):
    header: std_msgs.msg.Header
    cell_width: float
    cell_height: float
    cells: list[geometry_msgs.msg.Point]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        cell_width: float = ...,
        cell_height: float = ...,
        cells: list[geometry_msgs.msg.Point] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MapMetaData(Message):
    map_load_time: builtin_interfaces.msg.Time
    resolution: float
    width: int
    height: int
    origin: geometry_msgs.msg.Pose
    def __init__(
        self,
        *,
        map_load_time: builtin_interfaces.msg.Time = ...,
        resolution: float = ...,
        width: int = ...,
        height: int = ...,
        origin: geometry_msgs.msg.Pose = ...,
        check_fields: bool = ...,
    ) -> None: ...

class OccupancyGrid(Message):
    header: std_msgs.msg.Header
    info: MapMetaData
    @property
    def data(self) -> array[int]: ...
    @data.setter
    def data(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        info: MapMetaData = ...,
        data: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Odometry(Message):
    header: std_msgs.msg.Header
    child_frame_id: str
    pose: geometry_msgs.msg.PoseWithCovariance
    twist: geometry_msgs.msg.TwistWithCovariance
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        child_frame_id: str = ...,
        pose: geometry_msgs.msg.PoseWithCovariance = ...,
        twist: geometry_msgs.msg.TwistWithCovariance = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Path(Message):
    header: std_msgs.msg.Header
    poses: list[geometry_msgs.msg.PoseStamped]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        poses: list[geometry_msgs.msg.PoseStamped] = ...,
        check_fields: bool = ...,
    ) -> None: ...
