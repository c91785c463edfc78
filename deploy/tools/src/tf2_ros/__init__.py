"""Transforms between coordinate frames on ROS topics, with the API of ROS 2's tf2_ros."""

from geometry_msgs.msg import (
    PointStamped,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Vector3Stamped,
)
from rclpy.duration import Duration
from rclpy.time import Time

try:
    from tf2_msgs.msg import TFMessage
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "tf2_ros needs the messages of tf2_msgs, which ROS 2's wheels on PyPI do not have:"
        " use an installed ROS 2 or rclpy-cyclonedds, or build tf2_msgs",
        name=error.name,
    ) from None
from tf2_py import (
    BufferCore,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)
from tf2_ros.buffer import Buffer
from tf2_ros.buffer_client import BufferClient
from tf2_ros.buffer_interface import (
    BufferInterface,
    ConvertRegistration,
    NotImplementedException,
    Stamped,
    TransformRegistration,
    TypeException,
    convert,
)
from tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster
from tf2_ros.transform_broadcaster import TransformBroadcaster
from tf2_ros.transform_listener import TransformListener

__all__ = [
    "Buffer",
    "BufferClient",
    "BufferCore",
    "BufferInterface",
    "TransformListener",
    "TransformBroadcaster",
    "StaticTransformBroadcaster",
    "TransformRegistration",
    "ConvertRegistration",
    "Stamped",
    "convert",
    "TransformException",
    "ConnectivityException",
    "LookupException",
    "ExtrapolationException",
    "InvalidArgumentException",
    "TimeoutException",
    "TypeException",
    "NotImplementedException",
    # programs import these from here too: the original exports what its modules import
    "Duration",
    "PointStamped",
    "PoseStamped",
    "PoseWithCovarianceStamped",
    "TFMessage",
    "Time",
    "TransformStamped",
    "Vector3Stamped",
]
