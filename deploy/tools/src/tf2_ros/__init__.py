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
from tf2_msgs.msg import TFMessage
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
