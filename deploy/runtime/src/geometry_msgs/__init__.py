"""Interfaces of geometry_msgs, as in ROS 2 Jazzy."""
