"""Actions of tf2_msgs, as in ROS 2 Jazzy."""

from rosidl_runtime_embedded import interfaces

__getattr__, __dir__ = interfaces(__name__)
