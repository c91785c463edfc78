"""Point clouds from and to NumPy arrays and plain Python."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sensor_msgs.msg import PointCloud2, PointField
from sensor_msgs_py import point_cloud2
from std_msgs.msg import Header

HEADER = Header(frame_id="lidar")
XYZI = [
    PointField(name="x", offset=0, datatype=PointField.FLOAT32, count=1),
    PointField(name="y", offset=4, datatype=PointField.FLOAT32, count=1),
    PointField(name="z", offset=8, datatype=PointField.FLOAT32, count=1),
    PointField(name="intensity", offset=16, datatype=PointField.UINT16, count=1),
]
POINTS = [(0.0, 0.5, 1.0, 7), (1.5, math.nan, 2.0, 8), (-1.0, 2.5, 3.0, 65535)]


@pytest.fixture
def cloud() -> PointCloud2:
    cloud: PointCloud2 = point_cloud2.create_cloud(HEADER, XYZI, POINTS, point_step=20)
    return cloud


def test_a_cloud_has_the_layout_of_its_fields(cloud: PointCloud2) -> None:
    assert cloud.header.frame_id == "lidar"
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (3, 1, 20, 60)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "intensity"]
    assert not cloud.is_bigendian
    assert not cloud.is_dense
    assert len(cloud.data) == 60


def test_points_are_read_as_they_were_written(cloud: PointCloud2) -> None:
    points = point_cloud2.read_points(cloud)
    assert points.dtype == point_cloud2.dtype_from_fields(XYZI, point_step=20)
    np.testing.assert_equal([tuple(point) for point in points], POINTS)


def test_points_share_the_memory_of_the_message(cloud: PointCloud2) -> None:
    point_cloud2.read_points(cloud)["x"][2] = 4.0
    assert point_cloud2.read_points(cloud)["x"][2] == 4.0


def test_selected_fields_and_points_are_read(cloud: PointCloud2) -> None:
    points = point_cloud2.read_points(cloud, field_names=("intensity", "x"), uvs=[2, 0])
    assert points.dtype.names == ("intensity", "x")
    assert [tuple(point) for point in points] == [(65535, -1.0), (7, 0.0)]
    selected = point_cloud2.read_points(cloud, uvs=np.array([1]))
    assert [int(point["intensity"]) for point in selected] == [8]


def test_points_with_nan_in_a_selected_field_may_be_skipped(cloud: PointCloud2) -> None:
    assert len(point_cloud2.read_points(cloud, skip_nans=True)) == 2
    assert len(point_cloud2.read_points(cloud, field_names=["x", "z"], skip_nans=True)) == 3
    cloud.is_dense = True
    assert len(point_cloud2.read_points(cloud, skip_nans=True)) == 3


def test_fields_of_one_type_are_read_as_a_plain_array(cloud: PointCloud2) -> None:
    array = point_cloud2.read_points_numpy(cloud, field_names=["x", "z"])
    assert array.dtype == np.float32
    np.testing.assert_equal(array, [[0.0, 1.0], [1.5, 2.0], [-1.0, 3.0]])
    with pytest.raises(AssertionError):
        point_cloud2.read_points_numpy(cloud)


def test_points_are_read_as_named_tuples(cloud: PointCloud2) -> None:
    points = point_cloud2.read_points_list(cloud, skip_nans=True)
    assert [(point.x, point.intensity) for point in points] == [(0.0, 7), (-1.0, 65535)]


def test_a_cloud_in_the_other_byte_order_is_read(cloud: PointCloud2) -> None:
    type_ = point_cloud2.dtype_from_fields(XYZI, point_step=20)
    swapped = np.array(POINTS, type_.newbyteorder())
    cloud.data = list(swapped.tobytes())
    cloud.is_bigendian = True
    assert [int(point["intensity"]) for point in point_cloud2.read_points(cloud)] == [7, 8, 65535]


@pytest.mark.parametrize(
    "points",
    [
        [[1.0, 2.0, 3.0], (4.0, 5.0, 6.0)],
        iter([(1, 2, 3), (4, 5, 6)]),
        np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        np.array([[1, 4], [2, 5], [3, 6]], np.float32).T,
    ],
    ids=["lists", "iterator", "array", "strided array"],
)
def test_a_cloud_of_xyz_is_created_from_any_rows(points: Any) -> None:
    cloud = point_cloud2.create_cloud_xyz32(HEADER, points)
    assert (cloud.width, cloud.height, cloud.point_step) == (2, 1, 12)
    np.testing.assert_equal(point_cloud2.read_points_numpy(cloud), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


def test_a_cloud_is_created_from_a_structured_array_of_its_type(cloud: PointCloud2) -> None:
    again = point_cloud2.create_cloud(HEADER, XYZI, point_cloud2.read_points(cloud), point_step=20)
    np.testing.assert_equal(
        point_cloud2.read_points_list(again), [tuple(point) for point in point_cloud2.read_points(cloud)]
    )
    with pytest.raises(AssertionError):
        point_cloud2.create_cloud(HEADER, XYZI, np.zeros(3, [("x", "f4")]))


def test_an_organized_cloud_keeps_its_shape() -> None:
    points = np.arange(24, dtype=np.float32).reshape(4, 2, 3)
    cloud = point_cloud2.create_cloud_xyz32(HEADER, points)
    assert (cloud.width, cloud.height, cloud.row_step) == (4, 2, 48)
    np.testing.assert_equal(point_cloud2.read_points_numpy(cloud, reshape_organized_cloud=True), points)
    assert point_cloud2.read_points(cloud).shape == (8,)


def test_unnamed_fields_and_fields_of_several_elements_get_names() -> None:
    fields = [
        PointField(name="", offset=0, datatype=PointField.FLOAT64, count=1),
        PointField(name="rgb", offset=8, datatype=PointField.UINT8, count=3),
    ]
    type_ = point_cloud2.dtype_from_fields(fields)
    assert type_.names == ("unnamed_field_0", "rgb_0", "rgb_1", "rgb_2")
    assert [type_.fields[name][1] for name in type_.names] == [0, 8, 9, 10]
    assert type_.itemsize == 11


@pytest.mark.parametrize(
    "fields",
    [[XYZI[0], XYZI[0]], [PointField(name="none", datatype=PointField.INT8, count=0)]],
    ids=["twice", "no elements"],
)
def test_duplicate_and_empty_fields_are_an_error(fields: list[PointField]) -> None:
    with pytest.raises(AssertionError):
        point_cloud2.dtype_from_fields(fields)


def test_unknown_fields_and_other_messages_are_an_error(cloud: PointCloud2) -> None:
    with pytest.raises(AssertionError):
        point_cloud2.read_points(cloud, field_names=["w"])
    with pytest.raises(AssertionError):
        point_cloud2.read_points(HEADER)
