"""Names that public programs import from the modules of the tools; some are defined elsewhere."""

from __future__ import annotations

import importlib

import pytest

NO_TF2_MSGS = "platform: no tf2_msgs here, as with ROS 2's wheels"
NAMES = {
    "sensor_msgs_py.numpy_compat": "structured_to_unstructured unstructured_to_structured",
    "tf2_geometry_msgs": "Point PointStamped PolygonStamped Pose PoseStamped PoseWithCovarianceStamped"
    " TransformStamped Vector3Stamped",
    "tf2_ros": "Duration PointStamped PoseStamped PoseWithCovarianceStamped TFMessage Time TransformStamped"
    " Vector3Stamped",
}


@pytest.mark.parametrize("module", NAMES)
def test_names_that_programs_import_are_there(module: str) -> None:
    if module.startswith("tf2"):
        pytest.importorskip("tf2_msgs.msg", reason=NO_TF2_MSGS)
    here = importlib.import_module(module)
    assert [name for name in NAMES[module].split() if not hasattr(here, name)] == []


def test_imported_name_is_the_original() -> None:
    pytest.importorskip("tf2_msgs.msg", reason=NO_TF2_MSGS)
    from geometry_msgs.msg import TransformStamped

    import tf2_geometry_msgs
    import tf2_ros

    assert tf2_ros.TransformStamped is tf2_geometry_msgs.TransformStamped is TransformStamped
