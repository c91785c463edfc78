"""Interfaces of stereo_msgs, as in ROS 2 Jazzy."""
