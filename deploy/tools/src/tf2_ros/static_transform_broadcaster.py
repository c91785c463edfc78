"""Sends transforms that hold at all times."""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from tf2_ros.transform_broadcaster import as_list


class StaticTransformBroadcaster:
    """Publishes static transforms on ``/tf_static``; later subscribers get them as well."""

    def __init__(self, node: Node, qos: QoSProfile | int | None = None) -> None:
        """Create the publisher, by default reliable, transient local and with the last message."""
        if qos is None:
            qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.pub_tf = node.create_publisher(TFMessage, "/tf_static", qos)
        self.net_message = TFMessage()
        self._tf2_transforms: dict[str, TransformStamped] = {}  # by child frame

    def sendTransform(self, transform: TransformStamped | Iterable[TransformStamped]) -> None:
        """Publish all static transforms so far. A new transform of a child frame replaces the old one."""
        for one in as_list(transform):
            self._tf2_transforms[one.child_frame_id] = deepcopy(one)  # the caller may reuse the message
        self.net_message.transforms = list(self._tf2_transforms.values())
        self.pub_tf.publish(self.net_message)
