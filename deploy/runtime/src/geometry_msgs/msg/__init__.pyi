"""Messages of geometry_msgs. Made by rosidl_runtime_embedded.stubs."""

from collections.abc import Iterable
from typing import Final

import numpy
from numpy.typing import NDArray

import std_msgs.msg
from rosidl_runtime_embedded import Message

class Accel(Message):
    linear: Vector3
    angular: Vector3
    def __init__(
        self,
        *,
        linear: Vector3 = ...,
        angular: Vector3 = ...,
        check_fields: bool = ...,
    ) -> None: ...

class AccelStamped(Message):
    header: std_msgs.msg.Header
    accel: Accel
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        accel: Accel = ...,
        check_fields: bool = ...,
    ) -> None: ...

class AccelWithCovariance(Message):
    accel: Accel
    @property
    def covariance(self) -> NDArray[numpy.float64]: ...
    @covariance.setter
    def covariance(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        accel: Accel = ...,
        covariance: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class AccelWithCovarianceStamped(Message):
    header: std_msgs.msg.Header
    accel: AccelWithCovariance
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        accel: AccelWithCovariance = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Inertia(Message):
    m: float
    com: Vector3
    ixx: float
    ixy: float
    ixz: float
    iyy: float
    iyz: float
    izz: float
    def __init__(
        self,
        *,
        m: float = ...,
        com: Vector3 = ...,
        ixx: float = ...,
        ixy: float = ...,
        ixz: float = ...,
        iyy: float = ...,
        iyz: float = ...,
        izz: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class InertiaStamped(Message):
    header: std_msgs.msg.Header
    inertia: Inertia
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        inertia: Inertia = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Point(Message):
    x: float
    y: float
    z: float
    def __init__(
        self,
        *,
        x: float = ...,
        y: float = ...,
        z: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Point32(Message):
    x: float
    y: float
    z: float
    def __init__(
        self,
        *,
        x: float = ...,
        y: float = ...,
        z: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PointStamped(Message):
    header: std_msgs.msg.Header
    point: Point
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        point: Point = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Polygon(Message):
    points: list[Point32]
    def __init__(
        self,
        *,
        points: list[Point32] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PolygonInstance(Message):
    polygon: Polygon
    id: int
    def __init__(
        self,
        *,
        polygon: Polygon = ...,
        id: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PolygonInstanceStamped(Message):
    header: std_msgs.msg.Header
    polygon: PolygonInstance
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        polygon: PolygonInstance = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PolygonStamped(Message):
    header: std_msgs.msg.Header
    polygon: Polygon
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        polygon: Polygon = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Pose(Message):
    position: Point
    orientation: Quaternion
    def __init__(
        self,
        *,
        position: Point = ...,
        orientation: Quaternion = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Pose2D(Message):
    x: float
    y: float
    theta: float
    def __init__(
        self,
        *,
        x: float = ...,
        y: float = ...,
        theta: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PoseArray(Message):
    header: std_msgs.msg.Header
    poses: list[Pose]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        poses: list[Pose] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PoseStamped(Message):
    header: std_msgs.msg.Header
    pose: Pose
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        pose: Pose = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PoseWithCovariance(Message):
    pose: Pose
    @property
    def covariance(self) -> NDArray[numpy.float64]: ...
    @covariance.setter
    def covariance(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        pose: Pose = ...,
        covariance: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PoseWithCovarianceStamped(Message):
    header: std_msgs.msg.Header
    pose: PoseWithCovariance
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        pose: PoseWithCovariance = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Quaternion(Message):
    x: float
    y: float
    z: float
    w: float
    X__DEFAULT: Final = 0.0
    Y__DEFAULT: Final = 0.0
    Z__DEFAULT: Final = 0.0
    W__DEFAULT: Final = 1.0
    def __init__(
        self,
        *,
        x: float = ...,
        y: float = ...,
        z: float = ...,
        w: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class QuaternionStamped(Message):
    header: std_msgs.msg.Header
    quaternion: Quaternion
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        quaternion: Quaternion = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Transform(Message):
    translation: Vector3
    rotation: Quaternion
    def __init__(
        self,
        *,
        translation: Vector3 = ...,
        rotation: Quaternion = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TransformStamped(Message):
    header: std_msgs.msg.Header
    child_frame_id: str
    transform: Transform
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        child_frame_id: str = ...,
        transform: Transform = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Twist(Message):
    linear: Vector3
    angular: Vector3
    def __init__(
        self,
        *,
        linear: Vector3 = ...,
        angular: Vector3 = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TwistStamped(Message):
    header: std_msgs.msg.Header
    twist: Twist
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        twist: Twist = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TwistWithCovariance(Message):
    twist: Twist
    @property
    def covariance(self) -> NDArray[numpy.float64]: ...
    @covariance.setter
    def covariance(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        twist: Twist = ...,
        covariance: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TwistWithCovarianceStamped(Message):
    header: std_msgs.msg.Header
    twist: TwistWithCovariance
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        twist: TwistWithCovariance = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Vector3(Message):
    x: float
    y: float
    z: float
    def __init__(
        self,
        *,
        x: float = ...,
        y: float = ...,
        z: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Vector3Stamped(Message):
    header: std_msgs.msg.Header
    vector: Vector3
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        vector: Vector3 = ...,
        check_fields: bool = ...,
    ) -> None: ...

class VelocityStamped(Message):
    header: std_msgs.msg.Header
    body_frame_id: str
    reference_frame_id: str
    velocity: Twist
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        body_frame_id: str = ...,
        reference_frame_id: str = ...,
        velocity: Twist = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Wrench(Message):
    force: Vector3
    torque: Vector3
    def __init__(
        self,
        *,
        force: Vector3 = ...,
        torque: Vector3 = ...,
        check_fields: bool = ...,
    ) -> None: ...

class WrenchStamped(Message):
    header: std_msgs.msg.Header
    wrench: Wrench
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        wrench: Wrench = ...,
        check_fields: bool = ...,
    ) -> None: ...
