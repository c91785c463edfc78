"""Interfaces of service_msgs, as in ROS 2 Jazzy."""
