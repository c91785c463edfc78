from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("tf2_msgs.msg", reason="platform: no tf2_msgs here, as with ROS 2's wheels")

from geometry_msgs.msg import (
    Point,
    Point32,
    PointStamped,
    Polygon,
    PolygonStamped,
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    TransformStamped,
    Vector3,
    Vector3Stamped,
)
from std_msgs.msg import Header

import tf2_geometry_msgs
from tf2_ros import Buffer, convert

HALF = math.sqrt(0.5)


@pytest.fixture
def turn() -> TransformStamped:
    """From ``robot`` to ``map``: 90° about z, then 10 m along x and 1 m along z."""
    transform = TransformStamped()
    transform.header.frame_id = "map"
    transform.header.stamp.sec = 5
    transform.child_frame_id = "robot"
    transform.transform.translation = Vector3(x=10.0, y=0.0, z=1.0)
    transform.transform.rotation = Quaternion(x=0.0, y=0.0, z=HALF, w=HALF)
    return transform


def header(frame: str = "robot") -> Header:
    header = Header(frame_id=frame)
    header.stamp.sec = 5
    return header


def xyz(message: Any) -> Any:
    return pytest.approx((message.x, message.y, message.z), abs=1e-6)


def xyzw(message: Any) -> Any:
    return pytest.approx((message.x, message.y, message.z, message.w), abs=1e-12)


def test_a_point_is_rotated_and_translated(turn: TransformStamped) -> None:
    point = PointStamped(header=header(), point=Point(x=1.0, y=2.0, z=3.0))
    found = tf2_geometry_msgs.do_transform_point(point, turn)
    assert xyz(found.point) == (8.0, 1.0, 4.0)
    assert found.header == turn.header


def test_a_vector_is_only_rotated(turn: TransformStamped) -> None:
    vector = Vector3Stamped(header=header(), vector=Vector3(x=1.0, y=2.0, z=3.0))
    found = tf2_geometry_msgs.do_transform_vector3(vector, turn)
    assert xyz(found.vector) == (-2.0, 1.0, 3.0)
    assert found.header == turn.header


def test_a_pose_is_rotated_and_translated(turn: TransformStamped) -> None:
    pose = Pose(position=Point(x=1.0, y=2.0, z=3.0), orientation=Quaternion(x=0.0, y=0.0, z=HALF, w=HALF))
    found = tf2_geometry_msgs.do_transform_pose(pose, turn)
    assert xyz(found.position) == (8.0, 1.0, 4.0)
    assert abs(found.orientation.z) == pytest.approx(1.0)
    stamped = tf2_geometry_msgs.do_transform_pose_stamped(PoseStamped(header=header(), pose=pose), turn)
    assert stamped.pose == found
    assert stamped.header == turn.header


@pytest.mark.parametrize("degrees", [0.0, 45.0, 100.0, 170.0, -100.0, -170.0])
def test_the_orientation_is_composed(turn: TransformStamped, degrees: float) -> None:
    half = math.radians(degrees) / 2
    pose = Pose(orientation=Quaternion(x=math.sin(half), y=0.0, z=0.0, w=math.cos(half)))
    found = tf2_geometry_msgs.do_transform_pose(pose, turn)
    expected = (HALF * math.sin(half), HALF * math.sin(half), HALF * math.cos(half), HALF * math.cos(half))
    assert expected == xyzw(found.orientation)


def test_a_pose_without_an_orientation_counts_as_not_rotated(turn: TransformStamped) -> None:
    pose = Pose(orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=0.0))
    found = tf2_geometry_msgs.do_transform_pose(pose, turn)
    assert xyzw(found.orientation) == (0.0, 0.0, HALF, HALF)


def test_a_covariance_is_rotated(turn: TransformStamped) -> None:
    pose = PoseWithCovarianceStamped(header=header())
    pose.pose.pose.position = Point(x=1.0, y=2.0, z=3.0)
    generator = np.random.default_rng(1)
    covariance = generator.normal(size=(6, 6))
    pose.pose.covariance = covariance.ravel()
    found = tf2_geometry_msgs.do_transform_pose_with_covariance_stamped(pose, turn)
    assert xyz(found.pose.pose.position) == (8.0, 1.0, 4.0)
    # x and y exchange their places, and one of them its sign
    order, sign = [1, 0, 2, 4, 3, 5], np.array([-1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    expected = covariance[order][:, order] * np.outer(sign, sign)
    assert np.allclose(np.reshape(found.pose.covariance, (6, 6)), expected)
    assert found.header == turn.header
    assert np.allclose(tf2_geometry_msgs.transform_covariance(pose.pose.covariance, turn), expected.ravel())


def test_the_points_of_a_polygon_are_rotated_and_translated(turn: TransformStamped) -> None:
    polygon = PolygonStamped(header=header())
    polygon.polygon = Polygon(points=[Point32(x=1.0, y=2.0, z=3.0), Point32(x=0.0, y=0.0, z=0.5)])
    found = tf2_geometry_msgs.do_transform_polygon_stamped(polygon, turn)
    assert [xyz(point) for point in found.polygon.points] == [(8.0, 1.0, 4.0), (10.0, 0.0, 1.5)]
    assert found.header == turn.header
    assert tf2_geometry_msgs.do_transform_polygon_stamped(PolygonStamped(), turn).polygon.points == []


@pytest.mark.parametrize(
    "message",
    [
        PointStamped(header=header()),
        Vector3Stamped(header=header()),
        PoseStamped(header=header()),
        PoseWithCovarianceStamped(header=header()),
        PolygonStamped(header=header()),
    ],
    ids=lambda message: type(message).__name__,
)
def test_a_buffer_transforms_the_message(turn: TransformStamped, message: Any) -> None:
    buffer = Buffer()
    buffer.set_transform(turn, "test")
    found = buffer.transform(message, "map")
    assert type(found) is type(message)
    assert found.header == turn.header


@pytest.mark.parametrize("cls", [PointStamped, Vector3Stamped, PoseStamped])
def test_a_message_converts_to_its_own_type(cls: type) -> None:
    message = cls(header=header())
    assert convert(message, cls) == message
    assert tf2_geometry_msgs.to_msg_msg(message) is message
    assert tf2_geometry_msgs.from_msg_msg(message) is message
