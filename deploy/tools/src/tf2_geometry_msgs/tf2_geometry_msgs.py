"""The functions of tf2_geometry_msgs. The header of a result is that of the transform."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from geometry_msgs.msg import (
    Point,
    Point32,
    PointStamped,
    Polygon,
    PolygonStamped,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
    Vector3Stamped,
)
from numpy.typing import ArrayLike, NDArray

from tf2_py._matrices import Matrix, matrix_of, rotation_of, translation_of
from tf2_ros import ConvertRegistration, TransformRegistration

_T = TypeVar("_T")


def to_msg_msg(msg: _T) -> _T:
    """Return the message: it is one already."""
    return msg


def from_msg_msg(msg: _T) -> _T:
    """Return the message: it is one already."""
    return msg


def transform_covariance(cov_in: ArrayLike, transform: TransformStamped) -> NDArray[np.float64]:
    """Return the covariance of a pose in another frame: 6 × 6, of x, y, z and rotations about fixed axes."""
    rotation = np.kron(np.eye(2), _matrix(transform.transform)[:3, :3])
    covariance: Matrix = np.asarray(cov_in, float).reshape(6, 6)
    return np.ravel(rotation @ covariance @ rotation.T)


def do_transform_point(point: PointStamped, transform: TransformStamped) -> PointStamped:
    (row,) = _points([point.point], transform)
    return PointStamped(header=transform.header, point=Point(x=row[0], y=row[1], z=row[2]))


def do_transform_vector3(vector3: Vector3Stamped, transform: TransformStamped) -> Vector3Stamped:
    """Return a vector in another frame: it is rotated, not translated."""
    vector = vector3.vector
    x, y, z = (_matrix(transform.transform)[:3, :3] @ (vector.x, vector.y, vector.z)).tolist()
    return Vector3Stamped(header=transform.header, vector=Vector3(x=x, y=y, z=z))


def do_transform_pose(pose: Pose, transform: TransformStamped) -> Pose:
    """Return a pose in another frame; w of its orientation is not negative."""
    matrix = _matrix(transform.transform) @ _matrix(
        Transform(
            translation=Vector3(x=pose.position.x, y=pose.position.y, z=pose.position.z),
            rotation=pose.orientation,
        )
    )
    tx, ty, tz = translation_of(matrix)
    x, y, z, w = rotation_of(matrix)
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    return Pose(position=Point(x=tx, y=ty, z=tz), orientation=Quaternion(x=x, y=y, z=z, w=w))


def do_transform_pose_stamped(pose: PoseStamped, transform: TransformStamped) -> PoseStamped:
    """Return a pose in another frame; see :func:`do_transform_pose`."""
    return PoseStamped(header=transform.header, pose=do_transform_pose(pose.pose, transform))


def do_transform_pose_with_covariance_stamped(
    pose: PoseWithCovarianceStamped, transform: TransformStamped
) -> PoseWithCovarianceStamped:
    """Return a pose and its covariance in another frame; see :func:`do_transform_pose`."""
    return PoseWithCovarianceStamped(
        header=transform.header,
        pose=PoseWithCovariance(
            pose=do_transform_pose(pose.pose.pose, transform),
            covariance=transform_covariance(pose.pose.covariance, transform),
        ),
    )


def do_transform_polygon_stamped(polygon: PolygonStamped, transform: TransformStamped) -> PolygonStamped:
    points = [Point32(x=x, y=y, z=z) for x, y, z in _points(polygon.polygon.points, transform)]
    return PolygonStamped(header=transform.header, polygon=Polygon(points=points))


def _matrix(transform: Transform) -> Matrix:
    t, r = transform.translation, transform.rotation
    return matrix_of((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))


def _points(points: list[Point] | list[Point32], transform: TransformStamped) -> list[list[float]]:
    matrix = _matrix(transform.transform)
    rows = np.array([(point.x, point.y, point.z) for point in points]).reshape(-1, 3)
    moved: list[list[float]] = (rows @ matrix[:3, :3].T + matrix[:3, 3]).tolist()
    return moved


for _type, _function in (
    (PointStamped, do_transform_point),
    (Vector3Stamped, do_transform_vector3),
    (PoseStamped, do_transform_pose_stamped),
    (PoseWithCovarianceStamped, do_transform_pose_with_covariance_stamped),
    (PolygonStamped, do_transform_polygon_stamped),
):
    TransformRegistration().add(_type, _function)

for _type in (PointStamped, Vector3Stamped, PoseStamped):
    ConvertRegistration().add_to_msg(_type, to_msg_msg)
    ConvertRegistration().add_from_msg(_type, from_msg_msg)
