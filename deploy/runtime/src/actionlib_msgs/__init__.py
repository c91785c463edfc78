"""Interfaces of actionlib_msgs, as in ROS 2 Jazzy."""
