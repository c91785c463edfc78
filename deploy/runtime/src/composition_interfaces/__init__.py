"""Interfaces of composition_interfaces, as in ROS 2 Jazzy."""

from rosidl_runtime_embedded import kinds

__getattr__ = kinds(__name__)
