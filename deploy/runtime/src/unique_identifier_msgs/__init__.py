"""Interfaces of unique_identifier_msgs, as in ROS 2 Jazzy."""
