"""Interfaces of diagnostic_msgs, as in ROS 2 Jazzy."""
