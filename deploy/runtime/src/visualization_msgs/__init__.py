"""Interfaces of visualization_msgs, as in ROS 2 Jazzy."""
