"""A transform for the tests of tf2."""

from geometry_msgs.msg import TransformStamped


def transform(parent: str, child: str, x: float = 0.0, seconds: int = 1) -> TransformStamped:
    message = TransformStamped()
    message.header.frame_id = parent
    message.header.stamp.sec = seconds
    message.child_frame_id = child
    message.transform.translation.x = x
    message.transform.rotation.w = 1.0
    return message
