"""Point clouds as NumPy arrays: reads and creates sensor_msgs/msg/PointCloud2.

Wrong arguments raise AssertionError, as in common_interfaces.
"""

from __future__ import annotations

import sys
from array import array
from collections import namedtuple
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensor_msgs.msg import PointCloud2, PointField
from sensor_msgs_py.numpy_compat import structured_to_unstructured, unstructured_to_structured
from std_msgs.msg import Header

DUMMY_FIELD_PREFIX = "unnamed_field"

_BIG_ENDIAN = sys.byteorder == "big"
_TYPES = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}


def dtype_from_fields(fields: Iterable[PointField], point_step: int | None = None) -> np.dtype[Any]:
    """Return the type of a point with these fields, in this machine's byte order.

    A field without a name becomes ``unnamed_field_<number>``. A field of several elements becomes several
    fields, ``<name>_0`` and so on.

    :param point_step: size of a point [bytes]; by default, a point ends with its last field.
    """
    names: list[str] = []
    formats: list[str] = []
    offsets: list[int] = []
    for number, field in enumerate(fields):
        assert field.count > 0, f"field '{field.name}' has no elements (count=0)"
        assert field.datatype in _TYPES, f"field '{field.name}' has an unknown type: {field.datatype}"
        name, format_ = field.name or f"{DUMMY_FIELD_PREFIX}_{number}", np.dtype(_TYPES[field.datatype])
        names += [f"{name}_{element}" for element in range(field.count)] if field.count > 1 else [name]
        formats += [format_.str] * field.count
        offsets += [field.offset + element * format_.itemsize for element in range(field.count)]
    assert len(set(names)) == len(names), f"several fields have the same name: {', '.join(names)}"
    layout: Any = {"names": names, "formats": formats, "offsets": offsets}
    if point_step is not None:
        layout["itemsize"] = point_step
    type_: np.dtype[Any] = np.dtype(layout)
    return type_


def read_points(
    cloud: PointCloud2,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
    reshape_organized_cloud: bool = False,
) -> NDArray[Any]:
    """Return the points as a structured array, which shares the memory of the message if possible.

    :param field_names: the fields to read, by default all.
    :param skip_nans: whether to omit points with a NaN in one of these fields; a dense cloud has no such
        point.
    :param uvs: the indices of the points to read, by default all.
    :param reshape_organized_cloud: whether a cloud of several rows becomes an array of shape (width, height).
    """
    assert isinstance(cloud, PointCloud2), f"expected a PointCloud2, not {type(cloud).__name__}"
    native = dtype_from_fields(cloud.fields, cloud.point_step)
    foreign = bool(cloud.is_bigendian) != _BIG_ENDIAN
    type_ = native.newbyteorder() if foreign else native
    points: NDArray[Any] = np.ndarray((cloud.width * cloud.height,), type_, cloud.data)
    if foreign:
        points = points.astype(native)
    if field_names is not None:
        wanted = list(field_names)
        missing = [name for name in wanted if name not in (native.names or ())]
        assert not missing, f"the cloud has no field {', '.join(missing)}"
        points = points[wanted]
    if skip_nans and not cloud.is_dense:
        points = points[~np.any([np.isnan(points[name]) for name in points.dtype.names or ()], axis=0)]
    if uvs is not None:
        points = points[uvs if isinstance(uvs, np.ndarray) else np.fromiter(uvs, int)]
    if reshape_organized_cloud and cloud.height > 1:
        points = points.reshape(cloud.width, cloud.height)
    return points


def read_points_numpy(
    cloud: PointCloud2,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
    reshape_organized_cloud: bool = False,
) -> NDArray[Any]:
    """Return fields of one type as a plain array with a row for each point; see :func:`read_points`."""
    points = read_points(cloud, field_names, skip_nans, uvs, reshape_organized_cloud)
    assert len(_types(points.dtype)) <= 1, "the fields have several types: use read_points()"
    plain: NDArray[Any] = structured_to_unstructured(points)
    return plain


def read_points_list(
    cloud: PointCloud2,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
) -> list[Any]:
    """Return the points as named tuples; slower than :func:`read_points`."""
    points = read_points(cloud, field_names, skip_nans, uvs)
    point = namedtuple("Point", points.dtype.names or ())  # type: ignore[misc]  # names of the cloud
    return [point._make(values) for values in points]


def create_cloud(
    header: Header, fields: Sequence[PointField], points: Iterable[Any], point_step: int | None = None
) -> PointCloud2:
    """Return a cloud of points.

    :param points: the values of each point, in the order of the fields; or an array with a row for each
        point; or a structured array with the type of :func:`dtype_from_fields`. Another dimension makes an
        organized cloud: width by height.
    :param point_step: size of a point [bytes]; by default, a point ends with its last field.
    """
    type_ = dtype_from_fields(fields, point_step)
    if not isinstance(points, np.ndarray):
        structured = np.array([tuple(point) for point in points], type_)
    elif points.dtype.names is None:
        assert len(_types(type_)) <= 1, "the fields have several types: use a structured array"
        structured = unstructured_to_structured(points, type_)
    else:
        assert points.dtype == type_, f"points of type {points.dtype} do not fit the fields of type {type_}"
        structured = points
    assert structured.ndim <= 2, f"the points have {structured.ndim} dimensions: a cloud has at most 2"
    width, height = (*structured.shape, 1)[:2]
    return PointCloud2(
        header=header,
        height=height,
        width=width,
        is_dense=False,
        is_bigendian=_BIG_ENDIAN,
        fields=list(fields),
        point_step=type_.itemsize,
        row_step=type_.itemsize * width,
        data=array("B", structured.tobytes()),
    )


def create_cloud_xyz32(header: Header, points: Iterable[Any]) -> PointCloud2:
    """Return a cloud of points with the 32-bit fields x, y and z; see :func:`create_cloud`."""
    fields = [
        PointField(name=name, offset=4 * number, datatype=PointField.FLOAT32, count=1)
        for number, name in enumerate("xyz")
    ]
    return create_cloud(header, fields, points)


def _types(type_: np.dtype[Any]) -> set[np.dtype[Any]]:
    return {type_[name] for name in type_.names or ()}
