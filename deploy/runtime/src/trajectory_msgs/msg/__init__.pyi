"""Messages of trajectory_msgs. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable

import builtin_interfaces.msg
import geometry_msgs.msg
import std_msgs.msg
from rosidl_runtime_embedded import Message

class JointTrajectory(Message):
    header: std_msgs.msg.Header
    joint_names: list[str]
    points: list[JointTrajectoryPoint]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        joint_names: list[str] = ...,
        points: list[JointTrajectoryPoint] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class JointTrajectoryPoint(Message):
    @property
    def positions(self) -> array[float]: ...
    @positions.setter
    def positions(self, value: Iterable[float]) -> None: ...
    @property
    def velocities(self) -> array[float]: ...
    @velocities.setter
    def velocities(self, value: Iterable[float]) -> None: ...
    @property
    def accelerations(self) -> array[float]: ...
    @accelerations.setter
    def accelerations(self, value: Iterable[float]) -> None: ...
    @property
    def effort(self) -> array[float]: ...
    @effort.setter
    def effort(self, value: Iterable[float]) -> None: ...
    time_from_start: builtin_interfaces.msg.Duration
    def __init__(
        self,
        *,
        positions: Iterable[float] = ...,
        velocities: Iterable[float] = ...,
        accelerations: Iterable[float] = ...,
        effort: Iterable[float] = ...,
        time_from_start: builtin_interfaces.msg.Duration = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MultiDOFJointTrajectory(Message):
    header: std_msgs.msg.Header
    joint_names: list[str]
    points: list[MultiDOFJointTrajectoryPoint]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        joint_names: list[str] = ...,
        points: list[MultiDOFJointTrajectoryPoint] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MultiDOFJointTrajectoryPoint(Message):
    transforms: list[geometry_msgs.msg.Transform]
    velocities: list[geometry_msgs.msg.Twist]
    accelerations: list[geometry_msgs.msg.Twist]
    time_from_start: builtin_interfaces.msg.Duration
    def __init__(
        self,
        *,
        transforms: list[geometry_msgs.msg.Transform] = ...,
        velocities: list[geometry_msgs.msg.Twist] = ...,
        accelerations: list[geometry_msgs.msg.Twist] = ...,
        time_from_start: builtin_interfaces.msg.Duration = ...,
        check_fields: bool = ...,
    ) -> None: ...
