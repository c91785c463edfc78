"""Interfaces of statistics_msgs, as in ROS 2 Jazzy."""
