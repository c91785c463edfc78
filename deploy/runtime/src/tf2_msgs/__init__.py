"""Interfaces of tf2_msgs, as in ROS 2 Jazzy."""
