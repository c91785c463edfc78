"""Interfaces of lifecycle_msgs, as in ROS 2 Jazzy."""
