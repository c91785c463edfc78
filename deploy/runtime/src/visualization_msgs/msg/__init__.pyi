"""Messages of visualization_msgs. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable
from typing import Final

import builtin_interfaces.msg
import geometry_msgs.msg
import sensor_msgs.msg
import std_msgs.msg
from rosidl_runtime_embedded import Message

class ImageMarker(Message):
    header: std_msgs.msg.Header
    ns: str
    id: int
    type: int
    action: int
    position: geometry_msgs.msg.Point
    scale: float
    outline_color: std_msgs.msg.ColorRGBA
    filled: int
    fill_color: std_msgs.msg.ColorRGBA
    lifetime: builtin_interfaces.msg.Duration
    points: list[geometry_msgs.msg.Point]
    outline_colors: list[std_msgs.msg.ColorRGBA]
    CIRCLE: Final = 0
    LINE_STRIP: Final = 1
    LINE_LIST: Final = 2
    POLYGON: Final = 3
    POINTS: Final = 4
    ADD: Final = 0
    REMOVE: Final = 1
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        ns: str = ...,
        id: int = ...,
        type: int = ...,
        action: int = ...,
        position: geometry_msgs.msg.Point = ...,
        scale: float = ...,
        outline_color: std_msgs.msg.ColorRGBA = ...,
        filled: int = ...,
        fill_color: std_msgs.msg.ColorRGBA = ...,
        lifetime: builtin_interfaces.msg.Duration = ...,
        points: list[geometry_msgs.msg.Point] = ...,
        outline_colors: list[std_msgs.msg.ColorRGBA] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InteractiveMarker(Message):
    header: std_msgs.msg.Header
    pose: geometry_msgs.msg.Pose
    name: str
    description: str
    scale: float
    menu_entries: list[MenuEntry]
    controls: list[InteractiveMarkerControl]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        pose: geometry_msgs.msg.Pose = ...,
        name: str = ...,
        description: str = ...,
        scale: float = ...,
        menu_entries: list[MenuEntry] = ...,
        controls: list[InteractiveMarkerControl] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InteractiveMarkerControl(Message):
    name: str
    orientation: geometry_msgs.msg.Quaternion
    orientation_mode: int
    interaction_mode: int
    always_visible: bool
    markers: list[Marker]
    independent_marker_orientation: bool
    description: str
    INHERIT: Final = 0
    FIXED: Final = 1
    VIEW_FACING: Final = 2
    NONE: Final = 0
    MENU: Final = 1
    BUTTON: Final = 2
    MOVE_AXIS: Final = 3
    MOVE_PLANE: Final = 4
    ROTATE_AXIS: Final = 5
    MOVE_ROTATE: Final = 6
    MOVE_3D: Final = 7
    ROTATE_3D: Final = 8
    MOVE_ROTATE_3D: Final = 9
    def __init__(
        self,
        *,
        name: str = ...,
        orientation: geometry_msgs.msg.Quaternion = ...,
        orientation_mode: int = ...,
        interaction_mode: int = ...,
        always_visible: bool = ...,
        markers: list[Marker] = ...,
        independent_marker_orientation: bool = ...,
        description: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InteractiveMarkerFeedback(Message):
    header: std_msgs.msg.Header
    client_id: str
    marker_name: str
    control_name: str
    event_type: int
    pose: geometry_msgs.msg.Pose
    menu_entry_id: int
    mouse_point: geometry_msgs.msg.Point
    mouse_point_valid: bool
    KEEP_ALIVE: Final = 0
    POSE_UPDATE: Final = 1
    MENU_SELECT: Final = 2
    BUTTON_CLICK: Final = 3
    MOUSE_DOWN: Final = 4
    MOUSE_UP: Final = 5
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        client_id: str = ...,
        marker_name: str = ...,
        control_name: str = ...,
        event_type: int = ...,
        pose: geometry_msgs.msg.Pose = ...,
        menu_entry_id: int = ...,
        mouse_point: geometry_msgs.msg.Point = ...,
        mouse_point_valid: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InteractiveMarkerInit(Message):
    server_id: str
    seq_num: int
    markers: list[InteractiveMarker]
    def __init__(
        self,
        *,
        server_id: str = ...,
        seq_num: int = ...,
        markers: list[InteractiveMarker] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InteractiveMarkerPose(Message):
    header: std_msgs.msg.Header
    pose: geometry_msgs.msg.Pose
    name: str
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        pose: geometry_msgs.msg.Pose = ...,
        name: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InteractiveMarkerUpdate(Message):
    server_id: str
    seq_num: int
    type: int
    markers: list[InteractiveMarker]
    poses: list[InteractiveMarkerPose]
    erases: list[str]
    KEEP_ALIVE: Final = 0
    UPDATE: Final = 1
    def __init__(
        self,
        *,
        server_id: str = ...,
        seq_num: int = ...,
        type: int = ...,
        markers: list[InteractiveMarker] = ...,
        poses: list[InteractiveMarkerPose] = ...,
        erases: list[str] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Marker(Message):
    header: std_msgs.msg.Header
    ns: str
    id: int
    type: int
    action: int
    pose: geometry_msgs.msg.Pose
    scale: geometry_msgs.msg.Vector3
    color: std_msgs.msg.ColorRGBA
    lifetime: builtin_interfaces.msg.Duration
    frame_locked: bool
    points: list[geometry_msgs.msg.Point]
    colors: list[std_msgs.msg.ColorRGBA]
    texture_resource: str
    texture: sensor_msgs.msg.CompressedImage
    uv_coordinates: list[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool
    ARROW: Final = 0
    CUBE: Final = 1
    SPHERE: Final = 2
    CYLINDER: Final = 3
    LINE_STRIP: Final = 4
    LINE_LIST: Final = 5
    CUBE_LIST: Final = 6
    SPHERE_LIST: Final = 7
    POINTS: Final = 8
    TEXT_VIEW_FACING: Final = 9
    MESH_RESOURCE: Final = 10
    TRIANGLE_LIST: Final = 11
    ARROW_STRIP: Final = 12
    ADD: Final = 0
    MODIFY: Final = 0
    DELETE: Final = 2
    DELETEALL: Final = 3
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        ns: str = ...,
        id: int = ...,
        type: int = ...,
        action: int = ...,
        pose: geometry_msgs.msg.Pose = ...,
        scale: geometry_msgs.msg.Vector3 = ...,
        color: std_msgs.msg.ColorRGBA = ...,
        lifetime: builtin_interfaces.msg.Duration = ...,
        frame_locked: bool = ...,
        points: list[geometry_msgs.msg.Point] = ...,
        colors: list[std_msgs.msg.ColorRGBA] = ...,
        texture_resource: str = ...,
        texture: sensor_msgs.msg.CompressedImage = ...,
        uv_coordinates: list[UVCoordinate] = ...,
        text: str = ...,
        mesh_resource: str = ...,
        mesh_file: MeshFile = ...,
        mesh_use_embedded_materials: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MarkerArray(Message):
    markers: list[Marker]
    def __init__(
        self,
        *,
        markers: list[Marker] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MenuEntry(Message):
    id: int
    parent_id: int
    title: str
    command: str
    command_type: int
    FEEDBACK: Final = 0
    ROSRUN: Final = 1
    ROSLAUNCH: Final = 2
    def __init__(
        self,
        *,
        id: int = ...,
        parent_id: int = ...,
        title: str = ...,
        command: str = ...,
        command_type: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MeshFile(Message):
    filename: str
    @property
    def data(self) -> array[int]: ...
    @data.setter
    def data(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        filename: str = ...,
        data: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class UVCoordinate(Message):
    u: float
    v: float
    def __init__(
        self,
        *,
        u: float = ...,
        v: float = ...,
        check_fields: bool = ...,
    ) -> None: ...
