"""Interfaces of trajectory_msgs, as in ROS 2 Jazzy."""
