"""Messages of shape_msgs. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable
from typing import Final

import numpy
from numpy.typing import NDArray

import geometry_msgs.msg
from rosidl_runtime_embedded import Message

class Mesh(Message):
    triangles: list[MeshTriangle]
    vertices: list[geometry_msgs.msg.Point]
    def __init__(
        self,
        *,
        triangles: list[MeshTriangle] = ...,
        vertices: list[geometry_msgs.msg.Point] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MeshTriangle(Message):
    @property
    def vertex_indices(self) -> NDArray[numpy.uint32]: ...
    @vertex_indices.setter
    def vertex_indices(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        vertex_indices: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Plane(Message):
    @property
    def coef(self) -> NDArray[numpy.float64]: ...
    @coef.setter
    def coef(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        coef: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class SolidPrimitive(Message):
    type: int
    @property
    def dimensions(self) -> array[float]: ...
    @dimensions.setter
    def dimensions(self, value: Iterable[float]) -> None: ...
    polygon: geometry_msgs.msg.Polygon
    BOX: Final = 1
    SPHERE: Final = 2
    CYLINDER: Final = 3
    CONE: Final = 4
    PRISM: Final = 5
    BOX_X: Final = 0
    BOX_Y: Final = 1
    BOX_Z: Final = 2
    SPHERE_RADIUS: Final = 0
    CYLINDER_HEIGHT: Final = 0
    CYLINDER_RADIUS: Final = 1
    CONE_HEIGHT: Final = 0
    CONE_RADIUS: Final = 1
    PRISM_HEIGHT: Final = 0
    def __init__(
        self,
        *,
        type: int = ...,
        dimensions: Iterable[float] = ...,
        polygon: geometry_msgs.msg.Polygon = ...,
        check_fields: bool = ...,
    ) -> None: ...
