"""Interfaces of std_msgs, as in ROS 2 Jazzy."""
