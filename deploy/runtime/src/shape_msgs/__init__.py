"""Interfaces of shape_msgs, as in ROS 2 Jazzy."""
