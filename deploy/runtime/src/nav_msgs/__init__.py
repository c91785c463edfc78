"""Interfaces of nav_msgs, as in ROS 2 Jazzy."""
