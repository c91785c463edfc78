"""Interfaces of rosgraph_msgs, as in ROS 2 Jazzy."""
